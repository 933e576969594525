"""What the docstrings of effects share: parameters, sources that several cite, and an example."""

from __future__ import annotations

from typing import Any

from ..explained import Docstring

SHARED = """
B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, "A survey of models, analysis tools and compensation methods for
the control of machines with friction", Automatica 30(7), 1994. https://doi.org/10.1016/0005-1098(94)90209-7

B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE Control Systems
Magazine 20(2), 2000. https://doi.org/10.1109/37.833638

C.-P. Chou, B. Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles", IEEE Transactions on
Robotics and Automation 12(1), 1996. https://doi.org/10.1109/70.481753

E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical model",
Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

G. K. Klute, B. Hannaford, "Accounting for elastic energy storage in McKibben artificial muscle actuators", Journal of
Dynamic Systems, Measurement, and Control 122(2), 2000. https://doi.org/10.1115/1.482478

ISO 6358-1:2013, "Pneumatic fluid power - Determination of flow-rate characteristics of components using compressible
fluids".

K. Kuhnen, "Modeling, identification and compensation of complex hysteretic nonlinearities: a modified
Prandtl-Ishlinskii approach", European Journal of Control 9(4), 2003. https://doi.org/10.3166/ejc.9.407-418

M. Nordin, P.-O. Gutman, "Controlling mechanical systems with backlash: a survey", Automatica 38(10), 2002.
https://doi.org/10.1016/S0005-1098(02)00047-X

M. W. Spong, "Modeling and control of elastic joint robots", Journal of Dynamic Systems, Measurement, and Control
109(4), 1987. https://doi.org/10.1115/1.3143860

N. W. Tschoegl, "The Phenomenological Theory of Linear Viscoelastic Behavior", Springer, 1989.
https://doi.org/10.1007/978-3-642-73602-5

R. Isermann, "Fault-Diagnosis Systems", Springer, 2006. https://doi.org/10.1007/3-540-30368-5
"""
"""Sources, one a paragraph."""
_UNITS = {"-": "dimensionless", "m^3": "m³", "m^3/(s Pa)": "m³/(s Pa)", "N s^2": "N s²"}
"""How units are written for a reader."""
_POWERS = {-1: "", -2: "squared ", -3: "cubed "}


def explain(effect: type[Any]) -> None:
    """Complete the docstring of an effect of the library: parameters, the source that it names, and an example."""
    doc, p = Docstring(effect.__doc__), effect.parameters[0]
    laws = (Docstring(base.__doc__).head for base in effect.__mro__[1:])
    law = next((head for head in laws if ".. math::" in head), "")
    if "math::" not in doc.head:  # that of the law, wherever it acts
        doc.head += law[law.find("\n\n") :] if law else ""
    doc.sections.setdefault("Parameters", f"**values : float\n    {'; '.join(map(_told, effect.parameters))}.")
    if cited := [entry for entry in SHARED.strip().split("\n\n") if effect.source and effect.source in entry]:
        doc.sections.setdefault("References", cited[0])
    home, made, first = "pamid.effects", "make_effect", f'"{effect.name}", '
    if "name" not in vars(effect):  # of ports alone
        home, made, first = effect.__module__, effect.__name__, ""
    example = f">>> {made}({first}{p.name}={p.nominal:g})\n{effect()!r}"
    doc.sections.setdefault("Examples", f">>> from {home} import {made}\n{example}")
    effect.__doc__ = str(doc)


def _told(p: Any) -> str:
    """Return what a parameter is: its symbol, meaning and unit."""
    unit = _UNITS.get(p.unit, p.unit)
    if p.position > 0:
        unit = f"unit of the position{' per s' if p.unit == '1/s' else ''}"
    elif p.position < 0 and not p.periods:
        unit += f" per {_POWERS[p.position]}unit of the position"
    known = "; only for logs, a simulation knows it" if p.before else ""
    return f"``{p.name}`` {p.symbol}{', ' if p.symbol else ''}{p.description} ({unit}{known})"

"""What signals, equations and effects are called in text and on axes, and in which unit people read them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from ..plots.style import SHOWN
from ..simulators.between import ends_of
from ..simulators.dimensions import unit_powers

if TYPE_CHECKING:
    from ..gap.diagnosis.findings import Cause
    from ..gap.diagnosis.result import Diagnosis

NOT_EFFECTS = ("none", "unknown")
"""Candidates that are no effects."""


class DisplayedQuantity(NamedTuple):
    """A signal as people read it.

    Parameters
    ----------
    words : str
        What it is called.
    factor : float
        From SI to the unit shown.
    unit : str
        The unit shown; empty for a plain number.
    """

    words: str
    factor: float
    unit: str

    @property
    def label(self) -> str:
        """Text for an axis."""
        unit = typeset(self.unit)
        return f"{self.words} / {f'({unit})' if '/' in unit else unit}" if unit else self.words


SIGNALS = {
    "eps": DisplayedQuantity("contraction", 100.0, "%"),
    "deps": DisplayedQuantity("contraction rate", 100.0, "%/s"),
    "P": DisplayedQuantity("pressure, absolute", 1e-5, "bar"),
    "dP": DisplayedQuantity("pressure rate", 1e-5, "bar/s"),
    "u": DisplayedQuantity("valve command", 1.0, ""),
    "F": DisplayedQuantity("tension", 1.0, "N"),
    "mdot": DisplayedQuantity("mass flow", 1e6, "mg/s"),
    "q": DisplayedQuantity("joint angle", 180.0 / math.pi, "deg"),
    "dq": DisplayedQuantity("joint speed", 180.0 / math.pi, "deg/s"),
    "x": DisplayedQuantity("stroke", 1e3, "mm"),
    "dx": DisplayedQuantity("speed", 1e3, "mm/s"),
    "drive": DisplayedQuantity("drive", 1.0, ""),
    "q_ref": DisplayedQuantity("wanted joint angle", 180.0 / math.pi, "deg"),
    "time": DisplayedQuantity("time", 1.0, "s"),
}
"""Signals of a log and what follows from them."""


class _Spoken(NamedTuple):
    """What words need to know of a diagnosis: its simulator's ports, parameters, and units of its equations."""

    ports: Mapping[str, str] = MappingProxyType({})
    joints: frozenset[str] = frozenset()
    numbers: Mapping[str, Any] = MappingProxyType({})
    units: Mapping[str, str] = MappingProxyType({})


_SILENT = _Spoken()
_SPOKEN: ContextVar[_Spoken] = ContextVar("spoken", default=_SILENT)


@contextmanager
def names_of(diagnosis: Diagnosis) -> Iterator[None]:
    """Let signals, equations and parameters have the names and units of the simulator's ports, where it has any.

    `u` is then what that simulator calls `u`, and not the command of a valve.
    """
    ports = () if getattr(diagnosis.nominal, "states_equation", True) else diagnosis.nominal.ports
    numbers = diagnosis.nominal.parameters if ports else {}
    units = {e.equation: e.unit for e in diagnosis.equations} if ports else {}
    joints = frozenset(p.name for p in ports if p.kind == "joint")
    token = _SPOKEN.set(_Spoken({p.name: p.unit for p in ports}, joints, numbers, units))
    try:
        yield
    finally:
        _SPOKEN.reset(token)


def of_port(name: str) -> bool:
    """Return whether a signal is that of a port, see `names_of`."""
    return name in _SPOKEN.get().ports


def is_at_ports(equation: str) -> bool:
    """Return whether an equation is one of a simulator with ports, see `names_of`."""
    return equation in _SPOKEN.get().units


def number_of(name: str) -> Any:
    """Return the parameter of the simulator of a name; None where there is none."""
    return _SPOKEN.get().numbers.get(name)


RESIDUALS = {
    "force": "force error",
    "flow": "flow error",
    "valve": "valve flow error",
    "joint": "torque error",
    "gas_valve": "valve flow error",
    "joint_modelled": "torque error",
}
"""What an equation's residual is called."""


_AT_A_JOINT = {"N m": "torque", "N": "force"}
"""What acts at a joint, by its unit; in any other it is a drive."""


def equation(name: str) -> str:
    """Return what an equation is called: a bench's by its title, that of ports by what it balances."""
    from ..equations import all_equations

    spoken, known = _SPOKEN.get(), all_equations()
    if not is_at_ports(name):
        return known[name].title() if name in known else name
    unit, own = spoken.units[name], spoken.ports.get(name, "")
    if name in spoken.joints or (unit in _AT_A_JOINT and unit != own):
        return f"{_AT_A_JOINT.get(unit, 'drive')} at {name}"
    if unit_powers(unit) == unit_powers(f"{own}/s"):
        return f"rate of {name}"
    twice = unit_powers(unit) == unit_powers(f"{own}/s^2") or unit in ("m/s^2", "rad/s^2")
    return f"acceleration of {name}" if twice and unit != own else name


def in_equation(name: str) -> str:
    """Return in which equation something is: ``in the force equation``, ``in the torque at hinge``, ``in y``."""
    told = equation(name)
    if not is_at_ports(name):
        return f"in the {told} equation"
    return f"in {told}" if told == name else f"in the {told}"


_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_POWER = re.compile(r"(?<=\d)e([+-]?)0*(\d+)")


def typeset(text: str) -> str:
    """Write powers as such: ``2e-10 m^3`` becomes 2 · 10⁻¹⁰ m³."""
    text = _POWER.sub(lambda m: f" · 10{(m[1].replace('+', '') + m[2]).translate(_RAISED)}", text)
    return re.sub(r"\^(-?\d+)", lambda m: m[1].translate(_RAISED), text)


NAMES = ("coulomb", "stribeck", "bouc", "wen", "maxwell", "prandtl", "ishlinskii")
"""Words in names of effects that are names of people."""


def signal(name: str) -> DisplayedQuantity:
    """Return a signal by its column, ``eps1`` or ``eps`` alike; that of a port as its simulator has it."""
    if of_port(name):
        unit = _SPOKEN.get().ports[name]
        return DisplayedQuantity(name, 1.0, "" if unit == "-" else unit)
    bare = re.sub(r"[12]$", "", name)
    known = SIGNALS.get(name) or SIGNALS.get(bare)
    if known is None:
        return DisplayedQuantity(name, 1.0, "")
    muscle = name[len(bare) :]
    return known._replace(words=f"{known.words} of muscle {muscle}") if muscle and bare in SIGNALS else known


def residual(equation: str, unit: str) -> DisplayedQuantity:
    """Return an equation's residual as people read it."""
    of = target(equation, unit)
    return DisplayedQuantity(residual_words(equation, of.words), of.factor, of.unit)


def error(equation: str, unit: str) -> DisplayedQuantity:
    """Return an equation's residual as an axis has it, below which a caption says of what: a port's would be long."""
    found = residual(equation, unit)
    return found._replace(words="error") if is_at_ports(equation) else found


def residual_words(name: str, words: str = "") -> str:
    """Return what the residual of an equation is called."""
    if is_at_ports(name):
        told = equation(name)
        return f"error of {told}" if told == name else f"error of the {told}"
    return f"{words or target(name, '').words} error" if name == "torque" else RESIDUALS.get(name, f"{name} error")


_TARGETS = {
    "force": "force",
    "flow": "mass flow",
    "valve": "mass flow of the valve",
    "gas_valve": "mass flow of the valve",
    "joint": "torque",
    "joint_modelled": "torque",
    "torque": "torque",
}


def target(name: str, unit: str) -> DisplayedQuantity:
    """Return the measured side of an equation as people read it; a torque in another unit than N m is a drive."""
    factor, shown = SHOWN.get(unit, (1.0, unit))
    words = "drive" if name == "torque" and unit not in ("", "N m") else _TARGETS.get(name, name)
    words = equation(name) if is_at_ports(name) else words
    return DisplayedQuantity(words, factor, "" if shown == "drive unit" else shown)


def effect(name: str) -> str:
    """Return an effect's name as words: ``coulomb_friction`` is Coulomb friction."""
    words = re.split("[_ ]", name)  # several stand beside each other with "and"
    return " ".join(w.capitalize() if w in NAMES else w for w in words)


_SAID = {
    "settled": "share by which the springs had relaxed when a run begins",
    "unknown": "share of the state before a run that nobody knows",
    "carried": "share of its excess of temperature with which gas leaves",
}
"""Parameters whose names alone say nothing."""


def parameter(name: str) -> str:
    """Return the name of an effect's parameter in words."""
    return _SAID.get(name, name.replace("_", " "))


def placed(name: str, port: str) -> str:
    """Return an effect as words, with the port of a simulator at which it acts, or the two between which it does."""
    return said_at(effect(name), port)


def said_at(name: str, port: str) -> str:
    """Return a name with the port at which it is, or the two between which it is; alone where there is none."""
    if not port:
        return name
    return f"{name} {'at' if ends_of(port) is None else 'between'} {port}"


def places(cause: Cause) -> tuple[str, ...]:
    """Return the port of each effect of a cause; empty where the effect itself says where it acts."""
    return cause.where or ("",) * len(cause.effects)


def amount(value: float, unit: str = "", digits: int = 3) -> str:
    """Return a number with its unit, in plain characters."""
    if not math.isfinite(value):
        return "unknown"
    factor, shown = SHOWN.get(unit, (1.0, unit))
    text = f"{value * factor:.{digits}g}"
    return text if shown in ("", "-") else f"{text} {shown}"


def percent(share: float) -> str:
    """Return a share as a whole per cent; what is not quite all or nothing is not rounded to it."""
    if not math.isfinite(share):
        return "an unknown share"
    if 0.0 < share < 0.005:
        return "under 1 %"
    if 0.995 < share < 1.0:
        return "over 99 %"
    return f"{100 * share:.0f} %"


def at_least(share: float) -> str:
    """Return the least of several shares as a bound."""
    text = percent(share)
    return text if text.startswith("over") else f"{text} or more"


def span(low: float, high: float, unit: str = "") -> str:
    """Return an interval; an end that is not finite is said to be open."""
    if not (math.isfinite(low) or math.isfinite(high)):
        return "not bounded by this log"
    if not math.isfinite(low):
        return f"up to {amount(high, unit)}"
    if not math.isfinite(high):
        return f"from {amount(low, unit)}, no upper bound"
    _, shown = SHOWN.get(unit, (1.0, unit))
    tail = "" if shown in ("", "-") else f" {shown}"
    for digits in (3, 4, 5):  # a narrow interval takes the digits that show it
        ends = [amount(v, unit, digits).removesuffix(tail) for v in (low, high)]
        if ends[0] != ends[1]:
            break
    return f"{ends[0]} to {ends[1]}{tail}"


def cell(share: float) -> str:
    """Return a share as a whole per cent, short enough for a table."""
    return percent(share).replace("under ", "<").replace("over ", ">").replace("an unknown share", "")


def share_span(low: float, high: float) -> str:
    """Return an interval of shares."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return "not bounded by this log"
    if low == high:
        return f"{100 * low:.0f} %"
    if 0.9995 < low < high <= 1.0:
        return "over 99.9 %"
    for digits in (0, 1, 2):
        ends = [f"{100 * v:.{digits}f}" for v in (low, high)]
        if ends[0] != ends[1]:
            return f"{ends[0]} to {ends[1]} %"
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def probability(p: float) -> str:
    """Return a p value."""
    if not math.isfinite(p):
        return "p unknown"
    return "p < 0.001" if p < 0.001 else f"p = {p:.2g}"


def run_named(name: str) -> str:
    """Return a run's name in a sentence: ``run 2`` is called so, ``sine`` is the run sine."""
    return name if name.lower().startswith("run") else f"the run {name}"


def listed(words: list[str], last: str = "and") -> str:
    """Return words as a list of a sentence."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"

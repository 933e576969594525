"""What a diagnosis calls its signals, equations and numbers: a bench's words, or those of a simulator's ports."""

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, Self

from ..equations import all_equations
from ..gap.diagnosis.result import Diagnosis
from ..plots.style import SHOWN
from ..simulators.dimensions import unit_powers
from .quantities import SIGNALS, DisplayedQuantity

RESIDUALS = {
    "force": "force error",
    "flow": "flow error",
    "valve": "valve flow error",
    "joint": "torque error",
    "gas_valve": "valve flow error",
    "joint_modelled": "torque error",
}
"""What an equation's residual is called."""
_TARGETS = {
    "force": "force",
    "flow": "mass flow",
    "valve": "mass flow of the valve",
    "gas_valve": "mass flow of the valve",
    "joint": "torque",
    "joint_modelled": "torque",
    "torque": "torque",
}
_AT_A_JOINT = {"N m": "torque", "N": "force"}
"""What acts at a joint, by its unit; in any other it is a drive."""


class Words(NamedTuple):
    """Names and units of a diagnosis: of its simulator's ports, else of a bench."""

    ports: Mapping[str, str] = MappingProxyType({})
    """The unit of each port."""
    joints: frozenset[str] = frozenset()
    """Ports that are joints."""
    numbers: Mapping[str, Any] = MappingProxyType({})
    """Parameters of the simulator."""
    units: Mapping[str, str] = MappingProxyType({})
    """The unit of each equation at ports."""

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Self:
        """Return the words of a diagnosis."""
        simulator = diagnosis.nominal
        if simulator is None or not (ports := simulator.own_ports):
            return cls()
        joints = frozenset(p.name for p in ports if p.kind == "joint")
        units = {e.equation: e.unit for e in diagnosis.equations}
        return cls({p.name: p.unit for p in ports}, joints, simulator.parameters, units)

    def is_at_ports(self, equation: str) -> bool:
        """Return whether an equation is one of a simulator with ports."""
        return equation in self.units

    def equation(self, name: str) -> str:
        """Return the title of an equation: the bench's own, or the quantity that a port's balances."""
        known = all_equations()
        if not self.is_at_ports(name):
            return known[name].title() if name in known else name
        unit, own = self.units[name], self.ports.get(name, "")
        if name in self.joints or (unit in _AT_A_JOINT and unit != own):
            return f"{_AT_A_JOINT.get(unit, 'drive')} at {name}"
        if unit_powers(unit) == unit_powers(f"{own}/s"):
            return f"rate of {name}"
        twice = unit_powers(unit) == unit_powers(f"{own}/s^2") or unit in ("m/s^2", "rad/s^2")
        return f"acceleration of {name}" if twice and unit != own else name

    def in_equation(self, name: str) -> str:
        """Return in which equation something is: ``in the force equation``, ``in the torque at hinge``, ``in y``."""
        told = self.equation(name)
        if not self.is_at_ports(name):
            return f"in the {told} equation"
        return f"in {told}" if told == name else f"in the {told}"

    def signal(self, name: str) -> DisplayedQuantity:
        """Return a signal by its column, ``eps1`` or ``eps`` alike; that of a port as its simulator has it."""
        if name in self.ports:
            unit = self.ports[name]
            return DisplayedQuantity(name, 1.0, "" if unit == "-" else unit)
        bare = re.sub(r"[12]$", "", name)
        known = SIGNALS.get(name) or SIGNALS.get(bare)
        if known is None:
            return DisplayedQuantity(name, 1.0, "")
        muscle = name[len(bare) :]
        words, comma, which = known.words.partition(",")
        return (
            known._replace(words=f"{words} of muscle {muscle}{comma}{which}") if muscle and bare in SIGNALS else known
        )

    def residual(self, equation: str, unit: str) -> DisplayedQuantity:
        """Return an equation's residual as people read it."""
        of = self.target(equation, unit)
        return DisplayedQuantity(self.residual_words(equation, of.words), of.factor, of.unit)

    def error(self, equation: str, unit: str) -> DisplayedQuantity:
        """Return an equation's residual as an axis has it: the caption below says of what, which of a port is long."""
        found = self.residual(equation, unit)
        return found._replace(words="error") if self.is_at_ports(equation) else found

    def residual_words(self, name: str, words: str = "") -> str:
        """Return the name of an equation's residual."""
        if self.is_at_ports(name):
            told = self.equation(name)
            return f"error of {told}" if told == name else f"error of the {told}"
        if name == "torque":
            return f"{words or self.target(name, '').words} error"
        return RESIDUALS.get(name, f"{name} error")

    def target(self, name: str, unit: str) -> DisplayedQuantity:
        """Return the measured side of an equation as people read it; a torque in another unit than N m is a drive."""
        factor, shown = SHOWN.get(unit, (1.0, unit))
        words = "drive" if name == "torque" and unit not in ("", "N m") else _TARGETS.get(name, name)
        words = self.equation(name) if self.is_at_ports(name) else words
        return DisplayedQuantity(words, factor, "" if shown == "drive unit" else shown)


BENCH = Words()
"""The words of a bench, and of a system with one equation of pamid's signals."""

"""Units in which the parameters of an effect are reported: those of the log's own target, position and pressure."""

from __future__ import annotations

import re
from typing import NamedTuple

from ...effects import Effect, Parameter

_SYMBOL = re.compile(r"(kg|m\^3|[A-Za-z]+)(?:\^(\d+))?")


class Units(NamedTuple):
    """Units of a log of one equation."""

    target: str = "N"
    """Of what is measured."""
    position: str = "-"
    """Of the position; ``"-"`` for a contraction ratio."""
    pressure: str = "Pa"
    """Of the pressure, or its substitute."""

    def of(self, effect: type[Effect], p: Parameter) -> str:
        """Return the unit of an effect's parameter."""
        powers = powers_of(p.unit)
        own: dict[str, int] = {}
        force, mass = powers.pop("N", 0), powers.pop("kg", 0) if self.target != "kg/s" else 0
        if effect.site == "joint":
            _add(powers, "m", -force)  # a torque is a force times a length
            _add(own, self.position, powers.pop("rad", 0))
        if self.target != "kg/s":  # a flowing mass or volume is the integral of the target
            mass += powers.pop("m^3", 0)
            _add(powers, "s", mass)
        _add(own, self.position, p.position)
        _add(own, self.pressure, powers.pop("Pa", 0))
        whole: dict[str, int] = {}
        for name, power in [(self.target, force + mass), *powers.items(), *own.items()]:
            _add(whole, name, power)
        return _written(whole)


def powers_of(unit: str) -> dict[str, int]:
    """Return the powers of the symbols in a unit, such as N: 1, s: 1, rad: -1 for ``"N s/rad"``."""
    powers: dict[str, int] = {}
    for k, part in enumerate(unit.split("/")):
        for name, power in _SYMBOL.findall(part):
            _add(powers, name, int(power or 1) * (-1 if k else 1))
    return powers


def _add(powers: dict[str, int], name: str, power: int) -> None:
    if name not in ("-", "") and power:
        powers[name] = powers.get(name, 0) + power
        if not powers[name]:
            del powers[name]


def _written(powers: dict[str, int]) -> str:
    over = [_power(name, k) for name, k in powers.items() if k > 0]
    under = [_power(name, -k) for name, k in powers.items() if k < 0]
    if not over and not under:
        return "-"
    above = " ".join(over) or "1"
    if any(name.endswith(" unit") for name in powers):
        return " per ".join([above, *under])
    if not under:
        return above
    above = f"({above})" if "/" in above else above
    return f"{above}/{under[0]}" if len(under) == 1 and "/" not in under[0] else f"{above}/({' '.join(under)})"


def _power(name: str, power: int) -> str:
    if power == 1:
        return name
    return f"{name}^{power}" if re.fullmatch(r"[A-Za-z]+|[a-z]+ unit", name) else f"({name})^{power}"

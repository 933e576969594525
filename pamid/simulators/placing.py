"""Places where effects act: a law of the library is placed with its parameters in the units there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..effects import Effect, Parameter
from .dimensions import powers, unit_powers, unit_text
from .placement import Placement, Scales

PASCAL = {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "bar": 1e5, "MPa": 1e6}
"""Units of pressure, in Pa."""
STRAIN = 0.2
"""Strain in the library's units that corresponds to a signal's range."""
GAP = {"force": 10.0, "flow": 1e-4}
"""Force, N, and flow, kg/s, in the library's units that correspond to a gap."""
LIMITS = {"limit", "upper", "depth"}
"""Parameters that are an end of a range, of a command or a reading."""
QUARTER = 0.5 * np.pi
"""Largest phase, rad, between two rows of the fastest swing that they resolve."""


@dataclass(frozen=True)
class PortPlace:
    """Where effects of one kind act: a port, or two, its units, and what a log resolves there."""

    port: str
    """Name of the port."""
    kind: str
    """``"input"``, ``"output"``, ``"joint"`` or ``"chamber"``."""
    enters: str
    """``"input"``, ``"output"``, ``"state"`` or ``"link"``, as `Placement.enters`."""
    at: str
    """The input, output or state there."""
    scales: Scales
    target: str
    """Unit of what effects add or change."""
    signal: str
    """Unit of the signal that they follow."""
    follows: Mapping[str, str] = field(default_factory=dict)
    """Signals by role, of which an effect takes those that it reads."""
    reach: float = 0.0
    """Largest size of a command or reading; 0 where no range ends."""
    least: float = 0.0
    """Least end of a range."""
    range_of: float = 0.0
    """Range of the position, in the library's units."""
    turn: float = 0.0
    """A turn, in the same; 0 where nothing turns."""
    speed: float = 0.0
    """Largest speed, in the library's units."""
    interval: float = 0.0
    """Sampling interval, s; 0 where it does not matter."""

    def placed(self, name: str, effect: type[Effect], hidden: tuple[str, ...] = ()) -> Placement:
        """Return an effect here, some parameters fixed, the others in the units here and within what a log resolves."""
        known = powers_at(self.kind, effect)
        units = {p.name: self._unit(p, known.get(p.name, 0)) for p in effect.parameters}
        # Outside of muscles drag is as likely as any friction.
        changes = {"prior": 0.0} if name == "quadratic_drag" else {}
        bound = effect.narrowed(hidden, [self._resolved(p, effect) for p in effect.parameters], **changes)
        follows = {role: signal for role, signal in self.follows.items() if role in effect.roles}
        key = f"{name}@{self.port}"
        return Placement(key, name, self.port, bound, self.enters, self.at, follows, self.scales, known, units)

    def _unit(self, p: Parameter, power: int) -> str:
        """Return the unit of a parameter here."""
        words, found = unit_powers(p.unit), self.signal
        if self.kind in ("input", "output"):
            return unit_text([("s", words.get("s", 0)), (found, power)])
        own = {"N": self.target, "m": "", "kg": self.target, "rad": found if found != "-" else "rad"}
        if self.kind == "chamber" and self.target == "kg/s" and found in PASCAL:
            own = {"Pa": found}  # the library's units are those of a mass flow under a pressure
        elif self.kind == "chamber":  # the rate is in what flows out per second, be it by mass or by volume
            own |= {"Pa": found}
            flows = words.pop("kg", 0) + words.pop("m", 0) // 3
            words |= {"kg": flows, "s": words.get("s", 0) + flows}
        if p.unit == "rad/s":  # it is no angle of the joint
            own = {"rad": "-"}
        return unit_text([*((own.get(w, w), n) for w, n in words.items() if n), (found, power)])

    def _resolved(self, p: Parameter, effect: type[Effect]) -> Parameter:
        """Return a parameter within what the log resolves."""
        interval = self.interval * self.scales.time
        if self.reach and p.name in LIMITS:
            top, least = self.reach / self.scales.target, self.least / self.scales.target
            p = replace(p, lower=max(0.05 * top, least), upper=top, nominal=max(0.6 * top, least))
        p = p.over(self.range_of, self.speed, self.turn)
        if interval and p.unit == "rad/s":
            upper = max(min(p.upper, QUARTER / interval), 2.0 * p.lower)
            p = replace(p, upper=upper, nominal=min(p.nominal, 0.5 * upper))
        shortest = interval / effect.fastest
        if p.simplest and p.lower < shortest:  # relaxation within less looks like friction
            lower = min(shortest, 0.5 * p.upper)
            p = replace(p, lower=lower, nominal=max(p.nominal, 2.0 * lower))
        return p


def powers_at(kind: str, effect: type[Effect]) -> Mapping[str, int]:
    """Return the power of the signal's unit in each parameter of an effect at a port of a kind."""
    if kind == "chamber":
        return {}
    hook = "command" if "command" in effect.hooks() else "measure" if kind in ("input", "output") else "force"
    return powers(effect, hook) or {}


def hidden_of(effect: type[Effect], neutral: bool = True) -> tuple[str, ...]:
    """Return the parameters of an effect on a motion that no pressure and no neutral position give a meaning."""
    return tuple(p.name for p in effect.parameters if (neutral and p.neutral) or "Pa" in unit_powers(p.unit))


def follows_motion(effect: type[Effect]) -> bool:
    """Return whether an effect of a motion works where nothing else is known: neither a pressure nor a load."""
    if not set(effect.roles) <= {"position", "velocity", "pressure"}:
        return False
    free = any(p.linear and p.nominal and "Pa" not in unit_powers(p.unit) for p in effect.parameters)
    return free or "pressure" not in effect.roles

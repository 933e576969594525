"""An effect of the library placed at a port, with parameters in its units, bounded by what a log resolves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

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


def placed(
    name: str, effect: type[Effect], port: str, hook: str, enters: str, at: str, follows: Mapping[str, str],
    scales: Scales, target: str, signal: str, hidden: tuple[str, ...] = (), prior: float | None = None,
    reach: float = 0.0, least: float = 0.0, range_of: float = 0.0, speed: float = 0.0, interval: float = 0.0,
) -> Placement:  # fmt: skip
    """Return an effect at a port, its parameters in the units there."""
    key = f"{name}@{port}"
    known = {} if hook == "flow" else powers(effect, hook) or {}
    units = {}
    for p in effect.parameters:
        plain = [("s", unit_powers(p.unit).get("s", 0))]
        if hook in ("force", "flow"):
            words = {"N": target, "m": "", "kg": target, "rad": signal if signal != "-" else "rad"}
            powers_of = unit_powers(p.unit)
            if hook == "flow" and target == "kg/s" and signal in PASCAL:
                words = {"Pa": signal}  # the library's units are those of a mass flow under a pressure
            elif hook == "flow":  # the rate is in what flows out per second
                words |= {"Pa": signal}
                powers_of = {**powers_of, "s": powers_of.get("s", 0) + powers_of.get("kg", 0)}
            turns = p.unit != "rad/s"  # of a frequency it is no angle of the joint
            plain = [(words.get(w, w) if turns else w.replace("rad", "-"), n) for w, n in powers_of.items() if n]
        units[p.name] = unit_text([*plain, (signal, known.get(p.name, 0))])
    changes: dict[str, Any] = {} if prior is None else {"prior": prior}
    if reach and LIMITS & units.keys():
        top, low = reach / scales.target, least / scales.target
        changes["parameters"] = tuple(_reached(p, top, low) for p in effect.parameters)
    if any(p.periods or p.refines for p in effect.parameters):
        changes["parameters"] = tuple(p.over(range_of, speed) for p in effect.parameters)
    if any(_frequency(p) for p in effect.parameters):
        seen = QUARTER / (interval * scales.time) if interval else np.inf
        changes["parameters"] = tuple(_seen(p, seen) for p in effect.parameters)
    if interval and any(p.simplest for p in effect.parameters):
        known_from = interval * scales.time / effect.fastest
        changes["parameters"] = tuple(_remembered(p, known_from) for p in effect.parameters)
    bound = effect.narrowed(hidden, **changes)
    return Placement(key, name, port, bound, enters, at, follows, scales, known, units)


def _frequency(p: Parameter) -> bool:
    return p.unit == "rad/s"


def _seen(p: Parameter, fastest: float) -> Parameter:
    """Return a frequency bounded by the sampling."""
    if not _frequency(p):
        return p
    upper = max(min(p.upper, fastest), 2.0 * p.lower)
    return replace(p, upper=upper, nominal=min(p.nominal, 0.5 * upper))


def _remembered(p: Parameter, shortest: float) -> Parameter:
    """Return the shortest time constant that the sampling resolves: below it, relaxation looks like friction."""
    if not p.simplest or p.lower >= shortest:
        return p
    lower = min(shortest, 0.5 * p.upper)
    return replace(p, lower=lower, nominal=max(p.nominal, 2.0 * lower))


def _reached(p: Parameter, top: float, least: float) -> Parameter:
    """Return the limit of a saturation within the range of a signal, and its least value."""
    if p.name not in LIMITS:
        return p
    return replace(p, lower=max(0.05 * top, least), upper=top, nominal=max(0.6 * top, least))


def follows_motion(effect: type[Effect]) -> bool:
    """Return whether an effect of a motion works where nothing else is known: neither a pressure nor a load."""
    if not set(effect.roles) <= {"position", "velocity", "pressure"}:
        return False
    free = any(p.linear and p.nominal and "Pa" not in unit_powers(p.unit) for p in effect.parameters)
    return free or "pressure" not in effect.roles

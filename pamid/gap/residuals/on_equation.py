"""The effects of the library on one equation of an actuator, and what is typical of its log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...constants import ATMOSPHERIC_PRESSURE
from ...effects import Plant, all_effects
from ...signals.roles import ROLES
from ...simulators.placement import Placement, Scales
from ...simulators.placing import GAP, STRAIN
from ...simulators.sizes import typical_second
from .units import Units, powers_of

OUTPUT = {"force": "F", "torque": "F", "flow": "mdot"}
"""For each kind of target the sensor channel that measures it."""
SENSED = {channel: ROLES[channel] for channel in ("P", "q")}
"""For each sensor channel of an input its role."""
_READ = {"F": "N", "mdot": "kg", "P": "Pa", "q": "rad"}  # the word for its reading in units of the library
_PRESSURE = {"force": 5e5, "torque": 5e5, "flow": 2e3}  # Pa; of a flow that is not in pascal: a head


def on_equation(
    table: Mapping[str, np.ndarray], equation: str, scales: Scales, units: Units, plant: Plant | None
) -> dict[str, Placement]:
    """Return every effect of the library where it acts on an equation, by name; signals go by role."""
    gauge = "pressure" in table and _is_gauge(scales.pressure * table["pressure"])
    # What leaks depends on the absolute pressure.
    lacks = ATMOSPHERIC_PRESSURE if gauge and plant is None and equation == "flow" else 0.0
    scales = replace(scales, offset=lacks, ambient=ATMOSPHERIC_PRESSURE if lacks or not gauge else 0.0)
    found = {}
    for name, effect in all_effects().items():
        enters, at, own = "output", equation, replace(scales, target=abs(scales.target))
        powers = {p.name: p.position for p in effect.parameters}
        if "measure" in effect.hooks():
            powers = {p.name: powers_of(p.unit).get(_READ[effect.channel], 0) for p in effect.parameters}
            own = scales  # what a sensor of the target adds keeps its sign, whichever sense effects have
            if effect.channel in SENSED:
                enters, at = "input", SENSED[effect.channel]
                own = replace(scales, target=1.0 / scales.pressure if at == "pressure" else 1.0)
        elif effect.site == "joint":
            own = replace(own, position=1.0)
        told = {p.name: units.of(effect, p) for p in effect.parameters}
        follows = {role: role for role in table if role != "time"} | {"pressure": "pressure"}
        found[name] = Placement(name, name, "", effect, enters, at, follows, own, powers, told, numbers=plant)
    return found


def _is_gauge(pressure: np.ndarray) -> bool:
    """Return whether pressures are gauge pressures: absolute ones are not far below the ambient pressure."""
    return len(pressure) > 0 and float(np.min(pressure)) < 0.5 * ATMOSPHERIC_PRESSURE


def scales_of(
    table: Mapping[str, np.ndarray], residual: np.ndarray, run_length: float, interval: float, position: float,
    equation: str = "force",
) -> Scales:  # fmt: skip
    """Return what is typical of a log: what corresponds to one in the units of the library."""
    size = float(np.sqrt(np.mean(np.square(residual)))) if len(residual) else 0.0
    top = float(np.max(np.abs(table["pressure"]))) if "pressure" in table and len(table["pressure"]) else 0.0
    return Scales(
        position=position,
        time=typical_second(run_length, interval),
        pressure=_PRESSURE[equation] / top if 0.0 < top < 2e4 else 1.0,
        target=size / GAP["flow" if equation == "flow" else "force"] if size > 0 else 1.0,
    )


def strain_scale(position: np.ndarray, contraction: bool) -> float:
    """Return what counts as a strain of one: one for a contraction ratio, else five times the range."""
    span = float(np.ptp(position)) if len(position) else 0.0
    return 1.0 if contraction or span == 0.0 else span / STRAIN

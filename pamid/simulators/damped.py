"""The levers of a mechanism's joints, found among the parameters of its simulator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .base import Simulator
from .dimensions import unit_powers, unit_text
from .lever import Lever, slope
from .structure import JointPort, rate_unit, spread_numbers

SAME = 1e-6
"""Relative difference below which two slopes are equal."""


def levers_of(
    simulator: Simulator, joints: Sequence[JointPort], t: np.ndarray, x: np.ndarray, u: np.ndarray
) -> list[Lever]:
    """Return the levers of a mechanism's joints: of coefficients that multiply one speed, or the difference of two."""
    names = [j.velocity for j in joints if j.velocity]
    if simulator.form != "ode" or simulator.one_by_one or len(names) < 2 or not x.shape[1]:
        return []
    found, at = dict[tuple[str, ...], Lever](), (t, x, u, spread_numbers(simulator, len(t)))
    for parameter, number in simulator.parameters.items():

        def over(speeds: dict[str, float], parameter: str = parameter) -> np.ndarray:
            return slope(simulator, parameter, speeds, names, at)

        rest, each = over({}), {name: over({name: 1.0}) for name in names}
        whole = over(dict.fromkeys(names, 1.0))
        size = max(float(np.max(np.abs(d))) for d in each.values())
        if not np.isfinite(size) or not size > 0.0 or np.max(np.abs(rest)) > SAME * size:
            continue
        moving = [name for name, d in each.items() if np.max(np.abs(d)) > SAME * size]
        relative = len(moving) == 2 and np.max(np.abs(sum(each[n] for n in moving))) <= SAME * size
        if not (relative or len(moving) == 1) or tuple(moving) in found:
            continue
        straight = np.max(np.abs(over({moving[0]: 2.0}) - 2.0 * each[moving[0]])) <= SAME * size
        summed = np.max(np.abs(whole - sum(each.values()))) <= SAME * size
        if straight and summed:
            found[tuple(moving)] = _sized(simulator, parameter, number.unit, moving, -each[moving[0]])
    return list(found.values())


def _sized(simulator: Simulator, parameter: str, unit: str, moving: Sequence[str], response: np.ndarray) -> Lever:
    """Return a lever in newtons or newton metres where units say so, else in accelerations of its own joint."""
    powers = unit_powers(unit_text([(unit, 1), (simulator.port(moving[0]).unit, 1)]))
    powers.pop("rad", None)
    own = float(np.median(np.abs(response[simulator.states.index(moving[0])])))
    for name in ("N", "N m"):
        if powers in (unit_powers(name), _BASE[name]):
            return Lever(simulator, parameter, tuple(moving), 1.0, name, own)
    return Lever(simulator, parameter, tuple(moving), 1.0 / own, rate_unit(simulator, moving[0]), 1.0)


_BASE = {"N": {"kg": 1, "m": 1, "s": -2}, "N m": {"kg": 1, "m": 2, "s": -2}}
"""Units of forces in base units."""


def at_levers(
    levers: Sequence[Lever], joints: Sequence[JointPort], t: np.ndarray, x: np.ndarray, u: np.ndarray
) -> list[JointPort]:
    """Return the joints, those without an input with the response of a mechanism that couples them to others."""
    single = {lever.velocities[0]: lever for lever in levers if len(lever.velocities) == 1}
    found = []
    for joint in joints:
        lever = None if joint.through else single.get(joint.velocity)
        if lever is not None:
            moved = np.max(np.abs(lever.rates(t, x, u, spread_numbers(lever.simulator, len(t)))), axis=1)
            coupled = np.sum(moved > SAME * np.max(moved)) > 1
            joint = joint._replace(lever=lever, unit=lever.unit) if coupled else joint
        found.append(joint)
    return found

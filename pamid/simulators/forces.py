"""The force of one unit of an input, where a number of the simulator is the mass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .base import Simulator
from .dimensions import unit_powers, unit_text
from .structure import JointPort, pushes_of, spread_numbers

_STEP, _CLOSE = 1e-3, 1e-4


class ForcePerInput(NamedTuple):
    """The drive of a joint, as a force."""

    factor: float
    """Newtons or newton metres in a unit of the input."""
    unit: str
    """``"N"`` or ``"N m"``."""
    mass: str
    """The mass parameter."""


def force_per_input(
    simulator: Simulator, joint: JointPort, t: np.ndarray, x: np.ndarray, u: np.ndarray
) -> ForcePerInput | None:
    r"""Return the force per unit of a joint's input, :math:`F/u = m\,\partial\dot v/\partial u`; None without a mass.

    The mass m is a parameter of that unit to which all influences on the velocity's rate are inversely proportional.
    """
    if simulator.form != "ode" or not joint.velocity:
        return None
    speed = unit_powers(simulator.port(joint.velocity).unit)
    turns = "rad" in speed
    wanted, unit = ({"kg": 1, "m": 2}, "N m") if turns else ({"kg": 1}, "N")
    if (not turns and "m" not in speed) or unit_powers(joint.unit) in (unit_powers("N"), unit_powers("N m")):
        return None
    base = _pushes(simulator, joint, t, x, u)
    for name, p in simulator.parameters.items():
        if not len(base) or unit_powers(p.unit) != wanted or not p.value > 0.0:
            continue
        there = _pushes(simulator.with_({name: p.value * (1.0 + _STEP)}), joint, t, x, u)
        if len(there) == len(base) and np.all(np.abs(there * (1.0 + _STEP) / base - 1.0) < _CLOSE):
            return ForcePerInput(float(abs(base[0])) * p.value if joint.through else p.value, unit, name)
    return None


def _pushes(simulator: Simulator, joint: JointPort, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the slopes of a joint's acceleration over its input, or over all signals but its own where it has none."""
    if joint.through:
        step = 1e-3 * np.array([np.ptp(v) or 1.0 for v in u])
        push = pushes_of(simulator, t, x, u, step).get((joint.through, joint.velocity))
        return np.array([] if push is None else [push])
    p, row, slopes = spread_numbers(simulator, x.shape[1]), simulator.states.index(joint.velocity), []
    for which, values in (("x", x), ("u", u)):
        for k, value in enumerate(values):
            moved = values.copy()
            moved[k] += 1e-3 * (float(np.ptp(value)) or 1.0)
            there = simulator.rate(t, moved if which == "x" else x, moved if which == "u" else u, p)[row]
            slopes.append(there - simulator.rate(t, x, u, p)[row])
    found = np.concatenate(slopes)
    return found[np.abs(found) > 1e-6 * np.max(np.abs(found))] if np.any(found) else np.array([])


def as_force(value: float, unit: str, own: str, force: ForcePerInput) -> tuple[float, str]:
    """Return a size that is proportional to a force in newtons instead of the joint's own unit."""
    return value * force.factor, unit_text([(force.unit, 1), (own, -1), (unit, 1)])

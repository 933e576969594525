"""The force of one unit of an input, where a number of the simulator is the mass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .base import Simulator
from .dimensions import unit_powers, unit_text
from .structure import JointPort, pushes_of

_STEP, _CLOSE = 1e-3, 1e-4


class ForcePerInput(NamedTuple):
    """The drive of a joint, as a force.

    Parameters
    ----------
    factor : float
        Newtons or newton metres in a unit of the input.
    unit : str
        ``"N"`` or ``"N m"``.
    mass : str
        The mass parameter.
    """

    factor: float
    unit: str
    mass: str


def force_per_input(
    simulator: Simulator, joint: JointPort, t: np.ndarray, x: np.ndarray, u: np.ndarray
) -> ForcePerInput | None:
    r"""Return the force of one unit of the input that drives a joint; None where no parameter is the mass.

    A parameter m is the mass of the joint if it has that unit and the input's influence on the velocity's rate is
    inversely proportional to it. Then

    .. math:: F/u = m\,\partial\dot v/\partial u
    """
    if not joint.through or simulator.form != "ode":
        return None
    speed = unit_powers(simulator.port(joint.velocity).unit)
    turns = "rad" in speed
    wanted, unit = ({"kg": 1, "m": 2}, "N m") if turns else ({"kg": 1}, "N")
    if (not turns and "m" not in speed) or unit_powers(joint.unit) in (unit_powers("N"), unit_powers("N m")):
        return None
    step, where = 1e-3 * np.array([np.ptp(v) or 1.0 for v in u]), (joint.through, joint.velocity)
    base = pushes_of(simulator, t, x, u, step).get(where)
    for name, p in simulator.parameters.items():
        if base is None or unit_powers(p.unit) != wanted or not p.value > 0.0:
            continue
        heavier = simulator.with_({name: p.value * (1.0 + _STEP)})
        there = pushes_of(heavier, t, x, u, step).get(where, 0.0)
        if abs(there * (1.0 + _STEP) / base - 1.0) < _CLOSE:
            return ForcePerInput(abs(base) * p.value, unit, name)
    return None


def as_force(value: float, unit: str, own: str, force: ForcePerInput) -> tuple[float, str] | None:
    """Return a size in newtons instead of the joint's own unit; None where it is not a force."""
    if own in ("", "-") or unit_powers(unit).get(own, 0) != 1:
        return None
    return value * force.factor, unit_text([(force.unit, 1), (own, -1), (unit, 1)])

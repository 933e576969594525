"""Friction that falls with speed before it rises."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._laws import PRESLIDING, TRANSITION, Bristles
from .base import Signals
from .plant import Plant
from .values import Parameter


class StribeckFriction(Bristles):
    r"""Dry friction whose breakaway part fades with speed.

    .. math:: \Delta F = -\left(F_c + F_s\, e^{-(\dot x / v_s)^2}\right) z

    with the direction z of the motion, which turns over within the presliding displacement and fades below the
    transition speed as in `CoulombFriction`.

    Parameters
    ----------
    **values : float
        ``coulomb`` F_c (N), ``breakaway`` F_s, the excess at rest (N), ``velocity`` v_s (unit of the position per s),
        ``presliding`` (unit of the position), ``transition`` v_t (unit of the position per s).
    """

    name = "stribeck_friction"
    roles = ("position", "velocity")
    extends = "coulomb_friction"
    prior = -4.0  # friction alike at every speed is the simpler one
    source = "10.1016/0005-1098(94)90209-7"
    parameters = (
        Parameter("coulomb", "N", 0.0, 1e4, 3.0, "friction at speed", linear=True, essential=True),
        Parameter("breakaway", "N", 0.0, 1e4, 3.0, "excess at rest", linear=True, essential=True),
        Parameter("velocity", "1/s", 1e-4, 10.0, 0.02, "speed at which the excess fades", position=1),
        PRESLIDING,
        TRANSITION,
    )
    coulomb: float
    breakaway: float
    velocity: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the friction, N."""
        return -(self.coulomb + self.breakaway * np.exp(-((s.velocity / self.velocity) ** 2))) * self.turned(s, x)

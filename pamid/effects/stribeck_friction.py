"""Friction that falls with speed before it rises."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import dahl
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class StribeckFriction(Effect):
    r"""Dry friction whose breakaway part fades with speed.

    .. math:: \Delta F = -\left(F_c + F_s\, e^{-(\dot x / v_s)^2}\right) z

    with Dahl's bristle z, which turns over within the presliding displacement.

    Parameters
    ----------
    **values : float
        ``coulomb`` F_c (N), ``breakaway`` F_s, the excess at rest (N), ``velocity`` v_s (unit of the position per s),
        ``presliding`` (unit of the position).
    """

    name = "stribeck_friction"
    family = "friction"
    equations = ("force",)
    roles = ("position", "velocity")
    source = "10.1016/0005-1098(94)90209-7"
    n_states = 1
    path_dependent = True
    parameters = (
        Parameter("coulomb", "N", 0.0, 1e4, 3.0, "friction at speed", linear=True, essential=True),
        Parameter("breakaway", "N", 0.0, 1e4, 3.0, "excess at rest", linear=True, essential=True),
        Parameter("velocity", "1/s", 1e-4, 10.0, 0.02, "speed at which the excess fades", position=1),
        Parameter("presliding", "-", 1e-6, 2e-3, 2e-4, "displacement within which friction turns over", position=1),
    )
    coulomb: float
    breakaway: float
    velocity: float
    presliding: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return bristles at zero deflection."""
        return np.zeros((1, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Bend the bristles by the displacement between the two instants."""
        return dahl(x, s1.position - s0.position, self.presliding)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the friction, N."""
        return -(self.coulomb + self.breakaway * np.exp(-((s.velocity / self.velocity) ** 2))) * x[0]

"""Viscous friction that differs by the direction of the motion."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class DirectionalDamping(Effect):
    r"""Friction proportional to speed, with different slopes forwards and backwards.

    .. math:: \Delta F = -c_+\,\max(\dot x, 0) - c_-\,\min(\dot x, 0)

    Parameters
    ----------
    **values : float
        ``forward`` c₊ and ``backward`` c₋ (N s).
    """

    name = "directional_damping"
    family = "friction"
    equations = ("force",)
    roles = ("velocity",)
    kinds = ("actuator", "joint", "motor")
    prior = -4.0  # friction alike in both directions is the simpler one
    source = "10.1016/0005-1098(94)90209-7"
    parameters = (
        Parameter("forward", "N s", 0.0, 1e5, 60.0, "force per speed while the position grows", True, position=-1),
        Parameter(
            "backward", "N s", 0.0, 1e5, 40.0, "force per speed while it falls", True, unlike="forward", position=-1
        ),
    )
    forward: float
    backward: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −c ẋ with the slope of the direction, N."""
        return -self.forward * np.maximum(s.velocity, 0.0) - self.backward * np.minimum(s.velocity, 0.0)

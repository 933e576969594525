"""Drag that grows with the square of the speed."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class QuadraticDrag(Effect):
    r"""Drag of a body or a fluid at high speed.

    .. math:: \Delta F = -c\,|\dot x|\,\dot x

    References
    ----------
    G. K. Batchelor, "An Introduction to Fluid Dynamics", Cambridge University Press, 2000.
    https://doi.org/10.1017/CBO9780511800955
    """

    name = "quadratic_drag"
    family = "friction"
    equations = ("force",)
    roles = ("velocity",)
    prior = -6.0  # one of the common effects is nearly always equivalent
    source = "10.1017/CBO9780511800955"
    parameters = (
        Parameter("coefficient", "N s^2", 0.0, 1e6, 100.0, "force per squared rate", linear=True, position=-2),
    )
    coefficient: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −c |ẋ| ẋ, N."""
        return -self.coefficient * np.abs(s.velocity) * s.velocity

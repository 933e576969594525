"""Elastic force of the bladder."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class BladderElasticity(Effect):
    r"""Bladder that widens as the muscle contracts, which lowers the tension.

    .. math:: \Delta F = -k_1\,\varepsilon - k_3\,\varepsilon^3

    Parameters
    ----------
    **values : float
        ``stiffness`` k₁ (N), ``cubic`` k₃ (N).
    """

    name = "bladder_elasticity"
    family = "elasticity"
    equations = ("force",)
    roles = ("position",)
    source = "10.1115/1.482478"
    parameters = (
        Parameter("stiffness", "N", 0.0, 1e5, 150.0, "force per contraction", linear=True, position=-1),
        Parameter("cubic", "N", 0.0, 1e6, 0.0, "force per cubed contraction", linear=True, position=-3),
    )
    stiffness: float
    cubic: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k₁ ε − k₃ ε³, N."""
        return -(self.stiffness + self.cubic * s.position**2) * s.position

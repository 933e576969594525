"""A bladder that is stretched before the muscle contracts at all."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class BladderPreload(Effect):
    r"""Force of a bladder that resists even at rest length, and more as the muscle contracts.

    .. math:: \Delta F = -(F_0 + k\,\varepsilon + c\,\varepsilon^2)

    A negative c is a rubber that softens with stretch.

    Parameters
    ----------
    **values : float
        ``rest`` F₀, ``growth`` k and ``curvature`` c (N).
    """

    name = "bladder_preload"
    family = "elasticity"
    equations = ("force",)
    roles = ("position",)
    kinds = ("muscle",)
    source = "10.1115/1.482478"
    parameters = (
        Parameter("rest", "N", 0.0, 1e4, 30.0, "force at rest length", linear=True),
        Parameter("growth", "N", 0.0, 1e6, 500.0, "further force per contraction", linear=True, position=-1),
        Parameter("curvature", "N", -1e7, 1e7, 0.0, "the same per squared contraction", linear=True, position=-2),
    )
    rest: float
    growth: float
    curvature: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −(F₀ + k ε + c ε²), N."""
        return -(self.rest + (self.growth + self.curvature * s.position) * s.position)

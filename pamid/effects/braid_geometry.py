"""A braid whose diameter and angle differ from those of the model."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class BraidGeometry(Effect):
    r"""Braid whose diameter and angle differ from the model's, and hence the areas by which it pulls and pushes.

    .. math:: \Delta F = p \left(a\,(1 - \varepsilon)^2 - b\right), \qquad
        F = p\,\frac{\pi D_0^2}{4}\left(\frac{3\,(1 - \varepsilon)^2}{\tan^2\theta_0} - \frac{1}{\sin^2\theta_0}\right)

    with the gauge pressure p that presses on the braid. A geometry that was fitted to a log without the other causes
    holds part of them, and is corrected beside them.

    Parameters
    ----------
    **values : float
        ``pulling`` a, change of the area that pulls, and ``pushing`` b, change of the area that pushes (N/Pa = m²).
    """

    name = "braid_geometry"
    family = "geometry"
    equations = ("force",)
    roles = ("position", "pressure")
    kinds = ("muscle",)
    on_braid = True
    source = "10.1109/70.481753"
    parameters = (
        Parameter("pulling", "N/Pa", -0.1, 0.1, 1e-4, "change of the area that pulls", linear=True),
        Parameter("pushing", "N/Pa", -0.1, 0.1, 0.0, "change of the area that pushes", linear=True),
    )
    pulling: float
    pushing: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the tension of the areas that the model lacks, N."""
        return (s.pressure - plant.atmospheric_pressure) * (self.pulling * (1.0 - s.position) ** 2 - self.pushing)

"""Ends of the muscle that do not stay cylindrical, or that are compliant."""

from __future__ import annotations

from typing import ClassVar

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class EndCap(Effect):
    r"""Muscles of a bench whose active parts contract k times as much as the whole: conical or compliant ends.

    .. math:: \Delta F = \frac{p}{L_0}\left(\left.\frac{\partial V}{\partial\varepsilon}\right|_{k\varepsilon} -
        \left.\frac{\partial V}{\partial\varepsilon}\right|_{\varepsilon}\right), \qquad
        \Delta V = s \left(\frac{V(k\varepsilon) - V(0)}{k} - V(\varepsilon) + V(0)\right)

    Conical ends make k larger than 1, compliant ones smaller. Force and volume follow from one another by virtual work:
    s = 1 for ends of the assumed shape. Ends of another shape change it by a part; a force without a volume (s = 0)
    would do work that no gas provides.

    Parameters
    ----------
    **values : float
        ``factor`` k and ``swept`` s (dimensionless).
    """

    name = "end_cap"
    family = "elasticity"
    equations = ("force", "flow")
    roles = ("position", "velocity", "pressure")
    kinds = ("bench",)  # a single muscle has the effective contraction, whose volume nobody measures
    source = "10.1109/37.833638"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("factor", "-", 0.7, 1.6, 1.1, "contraction of the active part over that of the whole"),
        Parameter(
            "swept", "-", 0.5, 1.0, 1.0, "share of the change of shape that the gas feels as volume", simplest=True
        ),
    )
    factor: float
    swept: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force at the contraction k ε less that at ε, N."""
        change = plant.volume_slope(self.factor * s.position) - plant.volume_slope(s.position)
        return (s.pressure - plant.atmospheric_pressure) * change / plant.rest_length

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow that fills the change of volume."""
        k = self.factor
        slope = plant.volume_slope(k * s.position) - plant.volume_slope(s.position)
        rest = plant.volume(0.0 * s.position)
        change = (plant.volume(k * s.position) - rest) / k - plant.volume(s.position) + rest
        a = self.swept * s.pressure * slope * s.velocity / plant.RT
        return FlowTerm(a, self.swept * change / (plant.heat_capacity_ratio * plant.RT))

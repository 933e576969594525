"""Threads that stretch under pressure."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class ThreadExtensibility(Effect):
    r"""Threads that lengthen with the pressure, on which the volume then depends.

    .. math:: b = b_0\,(1 + \kappa p), \qquad \Delta F = \frac{p}{L_0}\left(\frac{\partial V(b)}{\partial
        \varepsilon} - \frac{\partial V(b_0)}{\partial\varepsilon}\right) = -p\,\frac{b^2 - b_0^2}{4\pi n^2}

    with the gauge pressure p; the flow gains :math:`\Delta V\,\dot P/(\gamma R T) + P\,\Delta\dot V/(R T)`.
    """

    name = "thread_extensibility"
    family = "elasticity"
    equations = ("force", "flow")
    roles = ("position", "velocity", "pressure")
    source = "10.1109/70.481753"
    parameters = (Parameter("compliance", "1/Pa", 0.0, 1e-6, 4e-8, "relative stretch per gauge pressure"),)
    compliance: float

    def _stretch(self, s: Signals, plant: Plant) -> tuple[Array, Array]:
        """Return the gauge pressure and b² − b₀²."""
        p = s.pressure - plant.atmospheric_pressure
        k = self.compliance * p
        return p, plant.thread_length**2 * k * (2.0 + k)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −p (b² − b₀²)/(4 π n²), N."""
        p, excess = self._stretch(s, plant)
        return -plant.shape * p * excess

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow that fills the extra volume."""
        p, excess = self._stretch(s, plant)
        length = plant.rest_length * (1.0 - s.position)
        slope_P = 2.0 * plant.shape * length * plant.thread_length**2 * self.compliance * (1.0 + self.compliance * p)
        a = -s.pressure * plant.shape * excess * plant.rest_length * s.velocity / plant.RT
        b = (plant.shape * length * excess / plant.heat_capacity_ratio + s.pressure * slope_P) / plant.RT
        return FlowTerm(a, b)

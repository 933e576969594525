"""Volume of fittings and tube."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class DeadVolume(Effect):
    r"""Fittings and tube that fill with the muscle but do no work.

    .. math:: \Delta\dot m = \frac{V_d\,\dot P}{\gamma R T}
    """

    name = "dead_volume"
    family = "gas"
    equations = ("flow",)
    roles = ("pressure_rate",)
    source = "10.1115/1.1286336"
    parameters = (Parameter("volume", "m^3", 0.0, 1e-3, 1e-5, "dead volume", linear=True),)
    volume: float

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return (0, V_d/(γ R T))."""
        return FlowTerm(0.0, self.volume / (plant.heat_capacity_ratio * plant.RT))

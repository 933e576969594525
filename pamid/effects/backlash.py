"""Play between the joint and the muscle."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class Backlash(Effect):
    r"""Lost motion between joint and muscle: after a reversal the muscle does not move until the play is used up.

    .. math:: y = \mathrm{play}_w(\varepsilon), \qquad
        \Delta F = \frac{P - P_\mathrm{atm}}{L_0}\,\big(V'(y) - V'(\varepsilon)\big), \qquad
        \Delta\dot m = \frac{\dot P\,(V(y) - V(\varepsilon))}{\gamma R T} +
        \frac{P\,(V'(y)\,\dot y - V'(\varepsilon)\,\dot\varepsilon)}{R T}

    Parameters
    ----------
    **values : float
        ``half_width`` w (unit of the position).
    """

    name = "backlash"
    family = "hysteresis"
    equations = ("force", "flow")
    roles = ("position", "velocity", "pressure")
    prior = -6.0  # rare on a bench whose muscles pull against each other
    source = "10.1016/S0005-1098(02)00047-X"
    n_states = 1
    path_dependent = True
    least_difference = 1e-9  # the driven side is engaged where it stands at an end of the play, up to rounding
    parameters = (Parameter("half_width", "-", 0.0, 0.1, 2e-3, "half the play", position=1),)
    half_width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the middle of the play."""
        return np.stack([s.position + 0.0])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Drag the driven side along where the play is used up."""
        return np.clip(x, s1.position - self.half_width, s1.position + self.half_width)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the tension at the driven side's contraction less that at the joint's, N."""
        slope = plant.volume_slope(x[0]) - plant.volume_slope(s.position)
        return (s.pressure - plant.atmospheric_pressure) / plant.rest_length * slope

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow of the driven side's volume less that of the joint's."""
        y = x[0]
        lost = s.position - y
        engaged = (np.abs(lost) >= (1.0 - self.least_difference) * self.half_width) & (lost * s.velocity >= 0.0)
        rate = plant.volume_slope(y) * np.where(engaged, s.velocity, 0.0) - plant.volume_slope(s.position) * s.velocity
        room = plant.volume(y) - plant.volume(s.position)
        return FlowTerm(s.pressure * rate / plant.RT, room / (plant.heat_capacity_ratio * plant.RT))

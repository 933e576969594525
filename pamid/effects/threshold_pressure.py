"""A bladder that does not press against the braid below a pressure."""

from __future__ import annotations

import math

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import BRAID_ANGLE, Plant
from .values import Parameter


class ThresholdPressure(Effect):
    r"""Pressure that widens the bladder until it meets the braid; below this pressure the muscle is slack.

    .. math:: \Delta F = \frac{p_e - p}{L_0}\,\frac{\partial V}{\partial\varepsilon}, \qquad
        p_e = \tfrac{1}{2}\left(d + \sqrt{d^2 + w^2}\right), \qquad
        d = p - p_0 - K \left(\frac{D(\varepsilon)}{D(0)} - 1\right), \qquad
        \frac{D(\varepsilon)}{D(0)} = \frac{\sqrt{1 - (1 - \varepsilon)^2 \cos^2\theta_0}}{\sin\theta_0}

    with the gauge pressure p and the diameter D of a braid that lies at θ₀ = 25° at rest, which grows as the muscle
    contracts. A bladder touches the braid at once (w = 0) or little by little.

    The angle is not that of the model: a geometry that was fitted without the bladder takes part of it for its braid
    and may come out at twice the angle, at which a diameter hardly grows. Other angles of real braids change K rather
    than the form.

    Parameters
    ----------
    **values : float
        ``pressure`` p₀ at rest length, ``growth`` K for a diameter twice that at rest, ``onset`` w (Pa).
    """

    name = "threshold_pressure"
    family = "elasticity"
    equations = ("force",)
    roles = ("position", "pressure")
    kinds = ("muscle",)
    source = "10.1109/70.481753"
    parameters = (
        Parameter("pressure", "Pa", 5e3, 3e5, 5e4, "threshold at rest length"),
        Parameter("growth", "Pa", 2e5, 5e6, 1e6, "growth of the threshold with the strain of the circumference"),
        Parameter("onset", "Pa", 0.0, 1e5, 0.0, "pressure over which the bladder meets the braid"),
    )
    pressure: float
    growth: float
    onset: float

    def braid_pressure(self, s: Signals, plant: Plant) -> Array:
        """Return the pressure that is left for the braid, Pa absolute."""
        # A thread of fixed length that winds less steeply encloses a wider tube.
        lying = np.clip((1.0 - np.asarray(s.position)) * math.cos(BRAID_ANGLE), -1.0, 1.0)
        wider = np.sqrt(1.0 - lying**2) / math.sin(BRAID_ANGLE) - 1.0
        over = s.pressure - plant.atmospheric_pressure - self.pressure - self.growth * wider
        return plant.atmospheric_pressure + 0.5 * (over + np.sqrt(over**2 + self.onset**2))

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the tension at the pressure that is left for the braid less that at the whole one, N."""
        return (self.braid_pressure(s, plant) - s.pressure) * plant.volume_slope(s.position) / plant.rest_length

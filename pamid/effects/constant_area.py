"""A muscle with a constant effective area, above the threshold pressure of its bladder."""

from __future__ import annotations

import math

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import BRAID_ANGLE, Plant
from .values import Parameter


class ConstantArea(Effect):
    r"""Constant area times the pressure above a threshold, instead of the geometric force.

    .. math:: \Delta F = A\,p_e - \frac{p}{L_0}\,\frac{\partial V}{\partial\varepsilon}, \qquad
        p_e = \tfrac{1}{2}\left(d + \sqrt{d^2 + w^2}\right), \qquad
        d = p - K\,\ln\frac{D(\varepsilon + \delta/L_0)}{D(0)}, \qquad
        \frac{D(\varepsilon)}{D(0)} = \frac{\sqrt{1 - (1 - \varepsilon)^2 \cos^2\theta_0}}{\sin\theta_0}

    with the gauge pressure p and the diameter D of a braid that lies at θ₀ = 25° at rest. It replaces the model's
    geometry and its corrections (`BraidGeometry`, `ThresholdPressure`, the bladder's forces), so a diagnosis considers
    it only by name. The area of a rubber muscle with its braid moulded in falls far less with the contraction than that
    of a braid of inextensible threads; a threshold grows instead, by the same pressure K for each further share of the
    circumference, the true strain ln D. The displacement δ, by which the braid is shorter than its fittings say,
    belongs to its ends: the threshold at rest falls with the length.

    Parameters
    ----------
    **values : float
        ``area`` A (N/Pa = m²), ``growth`` K (Pa), ``displacement`` δ (m), ``onset`` w (Pa).

    References
    ----------
    A pressure that is the sum of one for the contraction and one in proportion to the force, of muscles of 10 mm and
    several lengths: A. J. Hunt, A. Graber-Tilton, R. D. Quinn, "Modeling length effects of braided pneumatic
    actuators", ASME IDETC/CIE 2017, V05AT08A008. https://doi.org/10.1115/DETC2017-67458
    """

    name = "constant_area"
    family = "geometry"
    equations = ("force",)
    roles = ("position", "pressure")
    kinds = ()  # it replaces the model's geometry and all that corrects it: used only by name
    source = "10.1115/DETC2017-67458"
    parameters = (
        Parameter("area", "N/Pa", 1e-5, 2e-2, 7e-4, "force per pressure above the threshold"),
        Parameter("growth", "Pa", 1e5, 5e6, 1.2e6, "threshold where the braid is e times as wide as at rest"),
        Parameter("displacement", "m", 0.0, 2e-2, 2e-3, "length by which the braid is short at rest"),
        Parameter("onset", "Pa", 1e3, 3e5, 3e4, "pressure over which the bladder meets the braid"),
    )
    area: float
    growth: float
    displacement: float
    onset: float

    def threshold(self, s: Signals, plant: Plant) -> Array:
        """Return the gauge pressure that the bladder takes before the muscle pulls, Pa."""
        short = np.asarray(s.position) + self.displacement / plant.rest_length
        lying = np.clip((1.0 - short) * math.cos(BRAID_ANGLE), -1.0, 1.0)
        # A braid that is drawn beyond its rest length holds the bladder as it is.
        wider = np.maximum(np.sqrt(1.0 - lying**2) / math.sin(BRAID_ANGLE), 1.0)
        return self.growth * np.log(wider)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the tension of the pressure above the threshold less that of the model's geometry, N."""
        p = np.asarray(s.pressure) - plant.atmospheric_pressure
        over = p - self.threshold(s, plant)
        pulling = 0.5 * self.area * (over + np.sqrt(over**2 + self.onset**2))
        return pulling - p * plant.volume_slope(s.position) / plant.rest_length

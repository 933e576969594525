"""Force and volume of a muscle whose braid, bladder or ends are not those of the model."""

from __future__ import annotations

import math

import numpy as np

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import BRAID_ANGLE, Plant
from .values import parameter


class BraidGeometry(Effect):
    r"""Braid whose diameter or angle differs from the model's: the areas on which pressure pulls and pushes differ too.

    .. math:: \Delta F = p \left(a\,(1 - \varepsilon)^2 - b\right), \qquad
        F = p\,\frac{\pi D_0^2}{4}\left(\frac{3\,(1 - \varepsilon)^2}{\tan^2\theta_0} - \frac{1}{\sin^2\theta_0}\right)

    with the gauge pressure p that presses on the braid. A geometry that was fitted to a log without the other causes
    holds part of them, and is corrected beside them.
    """

    name = "braid_geometry"
    family = "geometry"
    roles = ("position", "pressure")
    kinds = ("muscle",)
    on_braid = True
    source = "10.1109/70.481753"
    pulling = parameter("N/Pa", -0.1, 0.1, 1e-4, "change of the area that pulls", linear=True, symbol="a")
    pushing = parameter("N/Pa", -0.1, 0.1, 0.0, "change of the area that pushes", linear=True, symbol="b")

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the tension of the areas that the model lacks, N."""
        return (s.pressure - plant.atmospheric_pressure) * (self.pulling * (1.0 - s.position) ** 2 - self.pushing)


class EndCap(Effect):
    r"""Conical or compliant ends of the bench's muscles, whose active part contracts more or less than the whole.

    .. math:: \Delta F = \frac{p}{L_0}\left(\left.\frac{\partial V}{\partial\varepsilon}\right|_{k\varepsilon} -
        \left.\frac{\partial V}{\partial\varepsilon}\right|_{\varepsilon}\right), \qquad
        \Delta V = s \left(\frac{V(k\varepsilon) - V(0)}{k} - V(\varepsilon) + V(0)\right)

    The active part contracts k times as much (``factor``): conical ends make k larger than 1, compliant ones smaller.
    Force and volume follow from one another by virtual work: s = 1 for ends of the assumed shape. Ends of another shape
    change it by a part; a force without a volume (s = 0) would do work that no gas provides.
    """

    name = "end_cap"
    family = "elasticity"
    roles = ("position", "velocity", "pressure")
    kinds = ("bench",)  # a single muscle has the effective contraction, whose volume nobody measures
    source = "10.1109/37.833638"
    factor = parameter("-", 0.7, 1.6, 1.1, "contraction of the active part over that of the whole", symbol="k")
    swept = parameter(
        "-", 0.5, 1.0, 1.0, "share of the change of shape that the gas feels as volume", simplest=True, symbol="s"
    )

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


class EffectiveContraction(EndCap):
    r"""Stiff or compliant ends of a single muscle, whose active part contracts more or less than the whole.

    .. math:: \Delta F = \frac{p}{L_0}\left(\left.\frac{\partial V}{\partial\varepsilon}\right|_{k\varepsilon} -
        \left.\frac{\partial V}{\partial\varepsilon}\right|_{\varepsilon}\right)

    The active part contracts k times as much (``factor``). Stiff fittings make k larger than 1; a braid that lengthens,
    or fittings that yield, smaller. The gas volume changes as in `EndCap` with s = 1.

    References
    ----------
    B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE Control Systems
    Magazine 20(2), 2000. https://doi.org/10.1109/37.833638
    """

    name = "effective_contraction"
    kinds = ("muscle",)
    factor = parameter("-", 0.05, 1.6, 0.8, "contraction of the active part over that of the whole")
    swept = 1.0


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

    References
    ----------
    A pressure that is the sum of one for the contraction and one in proportion to the force, of muscles of 10 mm and
    several lengths: A. J. Hunt, A. Graber-Tilton, R. D. Quinn, "Modeling length effects of braided pneumatic
    actuators", ASME IDETC/CIE 2017, V05AT08A008. https://doi.org/10.1115/DETC2017-67458
    """

    name = "constant_area"
    family = "geometry"
    roles = ("position", "pressure")
    kinds = ()  # it replaces the model's geometry and all that corrects it: used only by name
    source = "10.1115/DETC2017-67458"
    area = parameter("N/Pa", 1e-5, 2e-2, 7e-4, "force per pressure above the threshold", symbol="A")
    growth = parameter("Pa", 1e5, 5e6, 1.2e6, "threshold where the braid is e times as wide as at rest", symbol="K")
    displacement = parameter("m", 0.0, 2e-2, 2e-3, "length by which the braid is short at rest", symbol="δ")
    onset = parameter("Pa", 1e3, 3e5, 3e4, "pressure over which the bladder meets the braid", symbol="w")

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
    """

    name = "threshold_pressure"
    family = "elasticity"
    roles = ("position", "pressure")
    kinds = ("muscle",)
    source = "10.1109/70.481753"
    pressure = parameter("Pa", 5e3, 3e5, 5e4, "threshold at rest length", symbol="p₀")
    growth = parameter("Pa", 2e5, 5e6, 1e6, "growth of the threshold with the strain of the circumference", symbol="K")
    onset = parameter("Pa", 0.0, 1e5, 0.0, "pressure over which the bladder meets the braid", symbol="w")

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


class ThreadExtensibility(Effect):
    r"""Threads that lengthen with the pressure, making the volume pressure-dependent.

    .. math:: b = b_0\,(1 + \kappa p), \qquad \Delta F = \frac{p}{L_0}\left(\frac{\partial V(b)}{\partial
        \varepsilon} - \frac{\partial V(b_0)}{\partial\varepsilon}\right) = -p\,\frac{b^2 - b_0^2}{4\pi n^2}

    with the gauge pressure p; the flow gains :math:`\Delta V\,\dot P/(\gamma R T) + P\,\Delta\dot V/(R T)`.
    """

    name = "thread_extensibility"
    family = "elasticity"
    roles = ("position", "velocity", "pressure")
    source = "10.1109/70.481753"
    compliance = parameter("1/Pa", 0.0, 1e-6, 4e-8, "relative stretch per gauge pressure")

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

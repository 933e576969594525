"""Hysteresis that does not depend on the speed: Bouc-Wen, Maxwell slip, Prandtl-Ishlinskii."""

from __future__ import annotations

import numpy as np

from ..signals.paths import Path
from ..signals.state import Array
from ._memory import RATIOS, bouc_wen, stopped, stops_along, stops_force
from ._places import OfCommand, OnSignal
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class _Stops(OnSignal):
    """Elastic stops of three widths, the elements of a Prandtl–Ishlinskii operator, moved by a signal."""

    family = "hysteresis"
    n_states = len(RATIOS)
    narrow: float
    middle: float
    wide: float
    width: float

    @property
    def weights(self) -> tuple[float, float, float]:
        """Weights of the elements."""
        return self.narrow, self.middle, self.wide

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return stops in the middle of their range."""
        return np.zeros((len(RATIOS), *np.shape(self.signal(s))))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move the stops by the change between the two instants."""
        return stopped(x, self.signal(s1) - self.signal(s0), self.width)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the stops along each run, without a loop over time."""
        return stops_along(self.signal(s), self.width, starts)


_ELEMENTS = np.arange(-2, 3) / np.sqrt(2.0)
"""Where the elements lie, in standard deviations of the logarithm of their displacements."""


class Hysteresis(Effect):
    r"""Resistance that builds up gradually after a reversal, at any speed: Bouc–Wen, Maxwell slip, or both.

    .. math:: \Delta F = -\frac{1}{5} \sum_{k=-2}^{2} (A\,z_k + S\,s_k), \qquad
        \delta_k = \delta\,e^{k \sigma / \sqrt{2}}, \qquad
        \frac{\mathrm{d}z_k}{\mathrm{d}x} = \frac{1}{\delta_k} \left(1 - |z_k| \left(\beta\,
        \mathrm{sgn}(z_k\,\dot x) + 1 - \beta\right)\right)

    with z in [−1, 1] (Bouc–Wen of exponent 1, normalised) and s, which moves linearly by x / δ until it slips at ±1.
    Without spread σ all elements coincide. With it they slip one after the other, like the fibres of a braid, and give
    the smoother loops of Prandtl–Ishlinskii and Maxwell slip models.

    References
    ----------
    M. Ismail, F. Ikhouane, J. Rodellar, "The hysteresis Bouc-Wen model, a survey", Archives of Computational Methods
    in Engineering 16, 2009. https://doi.org/10.1007/s11831-009-9031-8; F. Al-Bender, V. Lampaert, J. Swevers, "The
    generalized Maxwell-slip model: a novel model for friction simulation and compensation", IEEE Transactions on
    Automatic Control 50(11), 2005, for Maxwell-slip elements. https://doi.org/10.1109/TAC.2005.858676
    """

    name = "hysteresis"
    family = "hysteresis"
    roles = ("position",)
    source = "10.1007/s11831-009-9031-8"
    n_states = 2 * len(_ELEMENTS)
    path_dependent = True
    amplitude = parameter("N", 0.0, 1e4, 8.0, "half the width of a full loop", linear=True, symbol="A")
    slip = parameter("N", 0.0, 1e4, 0.0, "the same of the Maxwell-slip elements", linear=True, symbol="S")
    displacement = parameter(
        "-", 1e-3, 0.5, 0.01, "displacement over which the force goes over", essential=True, position=1, symbol="δ"
    )
    shape = parameter("-", 0.5, 1.0, 0.5, "0.5: straight unloading, 1: Dahl", symbol="β")
    spread = parameter(
        "-", 0.0, 1.5, 0.0, "standard deviation of the logarithm of the elements' displacements", symbol="σ"
    )

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the state of the middle of the loop."""
        return np.zeros((self.n_states, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move along the loops by the displacement between the two instants."""
        moved, half = s1.position - s0.position, len(_ELEMENTS)
        alike = self.spread == 0.0
        lengths = np.full(1, self.displacement) if alike else self.displacement * np.exp(self.spread * _ELEMENTS)
        lengths = lengths.reshape(-1, *[1] * np.ndim(moved))
        rows = 1 if alike else half
        bent = bouc_wen(x[:rows], moved, lengths, self.shape)
        slipped = np.clip(x[half : half + rows] + moved / lengths, -1.0, 1.0)
        return np.concatenate([bent] * (half // rows) + [slipped] * (half // rows))

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of both kinds of elements against the motion, N."""
        half = len(_ELEMENTS)
        return -self.amplitude * x[:half].mean(axis=0) - self.slip * x[half:].mean(axis=0)


class PrandtlIshlinskii(_Stops):
    r"""Prandtl–Ishlinskii operator: elastic stops of three widths, whose weights may change with the position.

    .. math:: \Delta y = -\sum_{i=1}^{3} (w_i + v_i\,x)\,z_i, \qquad
        z_i = \frac{x - \mathrm{play}_{r_i}(x)}{r_i}, \qquad r_i = \tfrac{1}{3}\,r,\; r,\; 3\,r

    The position x of a piezo stage is the voltage that drives it.
    """

    name = "prandtl_ishlinskii"
    of = "position"
    roles = ("position",)
    kinds = ("actuator",)
    prior = -2.0  # elements alike, or spread evenly, are the simpler model
    source = "10.3166/ejc.9.407-418"
    path_dependent = True
    narrow = parameter("N", -1e3, 1e4, 2.0, "weight of the narrow stop", linear=True, symbol="w₁")
    middle = parameter("N", -1e3, 1e4, 2.0, "weight of the middle stop", linear=True, symbol="w₂")
    wide = parameter("N", -1e3, 1e4, 2.0, "weight of the wide stop", linear=True, symbol="w₃")
    narrow_slope = parameter("N", -1e4, 1e4, 0.0, "its change with the position", linear=True, position=-1, symbol="v₁")
    middle_slope = parameter("N", -1e4, 1e4, 0.0, "its change with the position", linear=True, position=-1, symbol="v₂")
    wide_slope = parameter("N", -1e4, 1e4, 0.0, "its change with the position", linear=True, position=-1, symbol="v₃")
    width = parameter(
        "-", 3e-3, 0.035, 0.03, "displacement over which the middle stop turns over", position=1, symbol="r"
    )

    def trace_along(self, path: Path, plant: Plant, dt: float) -> Array:
        """Return the stops along a path, without a loop over its turns."""
        return stops_along(path.position, self.width, path.starts)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the stops, N."""
        slopes = (self.narrow_slope, self.middle_slope, self.wide_slope)
        return stops_force(x, self.weights, slopes, s.position)


class PressureHysteresis(_Stops):
    r"""Prandtl–Ishlinskii operator in the pressure: braid and bladder resist both filling and venting.

    .. math:: \Delta F = -\sum_{i=1}^{3} (w_i + v_i\,\varepsilon)\,z_i, \qquad
        z_i = \frac{P - \mathrm{play}_{r_i}(P)}{r_i}, \qquad r_i = \tfrac{1}{3}\,r,\; r,\; 3\,r

    with elastic stops z in [−1, 1]. Their weights may change with the contraction.

    References
    ----------
    T. Vo-Minh, T. Tjahjowidodo, H. Ramon, H. Van Brussel, "A new approach to modeling hysteresis in a pneumatic
    artificial muscle using the Maxwell-slip model", IEEE/ASME Transactions on Mechatronics 16(1), 2011.
    https://doi.org/10.1109/TMECH.2009.2038373
    """

    name = "pressure_hysteresis"
    of = "pressure"
    roles = ("position", "pressure")
    kinds = ("muscle",)
    source = "10.1109/TMECH.2009.2038373"
    narrow = parameter("N", -1e3, 1e4, 0.0, "weight of the narrow stop", linear=True, symbol="w₁")
    middle = parameter("N", -1e3, 1e4, 5.0, "weight of the middle stop", linear=True, symbol="w₂")
    wide = parameter("N", -1e3, 1e4, 0.0, "weight of the wide stop", linear=True, symbol="w₃")
    narrow_growth = parameter("N", -1e5, 1e5, 0.0, "its growth per contraction", linear=True, position=-1, symbol="v₁")
    middle_growth = parameter("N", -1e5, 1e5, 0.0, "its growth per contraction", linear=True, position=-1, symbol="v₂")
    wide_growth = parameter("N", -1e5, 1e5, 0.0, "its growth per contraction", linear=True, position=-1, symbol="v₃")
    width = parameter(
        "Pa", 1e4, 2e5, 1e5, "pressure over which the middle stop goes from one end to the middle", symbol="r"
    )

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the stops, N."""
        growths = (self.narrow_growth, self.middle_growth, self.wide_growth)
        return stops_force(x, self.weights, growths, s.position)


class ActuatorHysteresis(_Stops, OfCommand):
    r"""Prandtl–Ishlinskii operator in the command: a piezo or a magnet lags behind its drive at any speed.

    .. math:: u' = u - \sum_{i=1}^{3} w_i\, r_i\, z_i, \qquad
        z_i = \frac{u - \mathrm{play}_{r_i}(u)}{r_i}, \qquad r_i = \tfrac{1}{3}\,r,\; r,\; 3\,r

    with elastic stops z in [−1, 1].
    """

    name = "actuator_hysteresis"
    kinds = ("motor",)
    prior = -2.0  # one play, or a lag, is the simpler model
    source = "10.3166/ejc.9.407-418"
    sampled = True
    narrow = parameter("-", -1.0, 1.0, 0.1, "share that the narrow stop holds back", linear=True, symbol="w₁")
    middle = parameter("-", -1.0, 1.0, 0.1, "share that the middle stop holds back", linear=True, symbol="w₂")
    wide = parameter("-", -1.0, 1.0, 0.1, "share that the wide stop holds back", linear=True, symbol="w₃")
    width = parameter("-", 0.01, 0.6, 0.2, "change of the command over which the middle stop slips", symbol="r")

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command less the output of the stops."""
        held = sum(w * ratio * z for w, ratio, z in zip(self.weights, RATIOS, x, strict=True))
        return u - self.width * held

"""Rate-independent hysteresis with memory."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import bouc_wen
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter

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

    Parameters
    ----------
    **values : float
        ``amplitude`` A of the Bouc–Wen elements and ``slip`` S of those that slip (N), ``displacement`` δ (unit of the
        position), ``shape`` β and ``spread`` σ (dimensionless).

    References
    ----------
    M. Ismail, F. Ikhouane, J. Rodellar, "The hysteresis Bouc-Wen model, a survey", Archives of Computational Methods
    in Engineering 16, 2009. https://doi.org/10.1007/s11831-009-9031-8; F. Al-Bender, V. Lampaert, J. Swevers, "The
    generalized Maxwell-slip model: a novel model for friction simulation and compensation", IEEE Transactions on
    Automatic Control 50(11), 2005, for Maxwell-slip elements. https://doi.org/10.1109/TAC.2005.858676
    """

    name = "hysteresis"
    family = "hysteresis"
    equations = ("force",)
    roles = ("position",)
    source = "10.1007/s11831-009-9031-8"
    n_states = 2 * len(_ELEMENTS)
    path_dependent = True
    parameters = (
        Parameter("amplitude", "N", 0.0, 1e4, 8.0, "half the width of a full loop", linear=True),
        Parameter("slip", "N", 0.0, 1e4, 0.0, "the same of the Maxwell-slip elements", linear=True),
        Parameter(
            "displacement",
            "-",
            1e-3,
            0.5,
            0.01,
            "displacement over which the force goes over",
            essential=True,
            position=1,
        ),
        Parameter("shape", "-", 0.5, 1.0, 0.5, "0.5: straight unloading, 1: Dahl"),
        Parameter("spread", "-", 0.0, 1.5, 0.0, "standard deviation of the logarithm of the elements' displacements"),
    )
    amplitude: float
    slip: float
    displacement: float
    shape: float
    spread: float

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

"""Rate-independent hysteresis with memory."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import bouc_wen
from .base import Effect, Parameter, Signals
from .plant import Plant

_ELEMENTS = np.arange(-2, 3) / np.sqrt(2.0)
"""Where the elements lie, in standard deviations of the logarithm of their displacements."""


class Hysteresis(Effect):
    r"""Bouc–Wen hysteresis: after a reversal the force goes over gradually, whatever the speed.

    .. math:: \Delta F = -\frac{A}{5} \sum_{k=-2}^{2} z_k, \qquad \frac{\mathrm{d}z_k}{\mathrm{d}x} = \frac{1}{\delta_k}
        \left(1 - |z_k| \left(\beta\,\mathrm{sgn}(z_k\,\dot x) + 1 - \beta\right)\right), \qquad
        \delta_k = \delta\,e^{k \sigma / \sqrt{2}}

    with z in [−1, 1] (Bouc–Wen of exponent 1, normalised). Without spread σ all elements are one. With it they go over
    one after the other, as do the fibres of a braid and the elements of a Maxwell slip or Prandtl–Ishlinskii model.

    Parameters
    ----------
    **values : float
        ``amplitude`` A (N), ``displacement`` δ (unit of the position), ``shape`` β and ``spread`` σ (dimensionless).

    References
    ----------
    M. Ismail, F. Ikhouane, J. Rodellar, "The hysteresis Bouc-Wen model, a survey", Archives of Computational Methods
    in Engineering 16, 2009. https://doi.org/10.1007/s11831-009-9031-8; F. Al-Bender, V. Lampaert, J. Swevers, "The
    generalized Maxwell-slip model: a novel model for friction simulation and compensation", IEEE Transactions on
    Automatic Control 50(11), 2005, for elements side by side. https://doi.org/10.1109/TAC.2005.858676

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("hysteresis", amplitude=8)
    hysteresis(amplitude=8 N, displacement=0.01, shape=0.5, spread=0)
    """

    name = "hysteresis"
    family = "hysteresis"
    equations = ("force",)
    roles = ("position",)
    source = "10.1007/s11831-009-9031-8"
    n_states = len(_ELEMENTS)
    path_dependent = True
    parameters = (
        Parameter("amplitude", "N", 0.0, 1e4, 8.0, "half the width of a full loop", linear=True),
        Parameter("displacement", "-", 1e-3, 0.5, 0.01, "displacement over which the force goes over", essential=True),
        Parameter("shape", "-", 0.5, 1.0, 0.5, "0.5: straight unloading, 1: Dahl"),
        Parameter("spread", "-", 0.0, 1.5, 0.0, "standard deviation of the logarithm of the elements' displacements"),
    )
    amplitude: float
    displacement: float
    shape: float
    spread: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the state of the middle of the loop."""
        return np.zeros((self.n_states, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move along the loop by the displacement between the two instants."""
        moved = s1.position - s0.position
        if self.spread == 0.0:
            return np.broadcast_to(bouc_wen(x[:1], moved, self.displacement, self.shape), x.shape)
        lengths = self.displacement * np.exp(self.spread * _ELEMENTS)
        return bouc_wen(x, moved, lengths.reshape(-1, *[1] * np.ndim(moved)), self.shape)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −A times the elements' mean, N."""
        return -self.amplitude * (x[0] if self.spread == 0.0 else x.mean(axis=0))

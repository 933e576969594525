"""Rate-independent hysteresis with memory."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import bouc_wen
from .base import Effect, Parameter, Signals
from .plant import Plant


class Hysteresis(Effect):
    r"""Bouc–Wen hysteresis: after a reversal the force goes over gradually, whatever the speed.

    .. math:: \Delta F = -A\, z, \qquad \frac{\mathrm{d}z}{\mathrm{d}x} = \frac{1}{\delta}\left(1 - |z|
        \left(\beta\,\mathrm{sgn}(z\,\dot x) + 1 - \beta\right)\right)

    with z in [−1, 1] (Bouc–Wen of exponent 1, normalised).

    Parameters
    ----------
    **values : float
        ``amplitude`` A (N), ``displacement`` δ (unit of the position), ``shape`` β (dimensionless).

    References
    ----------
    M. Ismail, F. Ikhouane, J. Rodellar, "The hysteresis Bouc-Wen model, a survey", Archives of Computational Methods
    in Engineering 16, 2009. https://doi.org/10.1007/s11831-009-9031-8

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("hysteresis", amplitude=8)
    hysteresis(amplitude=8 N, displacement=0.01, shape=0.5)
    """

    name = "hysteresis"
    family = "hysteresis"
    equations = ("force",)
    roles = ("position",)
    source = "10.1007/s11831-009-9031-8"
    n_states = 1
    path_dependent = True
    parameters = (
        Parameter("amplitude", "N", 0.0, 1e4, 8.0, "half the width of a full loop", linear=True),
        Parameter("displacement", "-", 1e-3, 0.5, 0.01, "displacement over which the force goes over", essential=True),
        Parameter("shape", "-", 0.5, 1.0, 0.5, "0.5: straight unloading, 1: Dahl"),
    )
    amplitude: float
    displacement: float
    shape: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the state of the middle of the loop."""
        return np.zeros((1, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move along the loop by the displacement between the two instants."""
        return bouc_wen(x, s1.position - s0.position, self.displacement, self.shape)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −A z, N."""
        return -self.amplitude * x[0]

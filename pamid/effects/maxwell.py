"""Relaxation over three decades of time."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._laws import Branches
from ._memory import mostly_lasting
from .base import Signals
from .plant import Plant
from .values import Parameter


class Maxwell(Branches):
    r"""Generalised Maxwell model: three springs in series with dampers, their time constants a decade apart.

    .. math:: \Delta F = -\sum_{i=1}^{3} k_i\,(x - x_i), \qquad \tau_i\,\dot x_i = x - x_i, \qquad
        \tau_i = \tfrac{1}{10}\,\tau,\; \tau,\; 10\,\tau

    Parameters
    ----------
    **values : float
        ``fast``, ``middle``, ``slow`` k (N per unit of the position), ``time_constant`` τ of the middle branch (s).
    """

    name = "maxwell"
    of = "position"
    ratios = (0.1, 1.0, 10.0)
    roles = ("position",)
    kinds = ("actuator", "joint", "motor")
    prior = -4.0  # two springs, creep, are the simpler model
    n_states = 3
    fastest = min(ratios)
    parameters = (
        Parameter("fast", "N", 0.0, 1e5, 50.0, "stiffness of the fast branch", linear=True, position=-1),
        Parameter("middle", "N", 0.0, 1e5, 50.0, "stiffness of the middle branch", linear=True, position=-1),
        Parameter("slow", "N", 0.0, 1e5, 50.0, "stiffness of the slow branch", linear=True, position=-1),
        Parameter("time_constant", "s", 0.02, 100.0, 0.5, "relaxation time of the middle branch", simplest=True),
    )
    fast: float
    middle: float
    slow: float

    def elastic(self, seconds: float) -> bool:
        """Return whether most of the stiffness does not relax."""
        return mostly_lasting((self.fast, self.middle, self.slow), self._taus, seconds)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the three branches, N."""
        stiffness = (self.fast, self.middle, self.slow)
        parts = (k * (s.position - v) for k, v in zip(stiffness, x, strict=True))
        return -sum(parts, start=np.zeros(np.shape(x[0])))

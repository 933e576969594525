"""Relaxation over three decades of time."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import branches_along, branches_at, branches_relax, mostly_lasting
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter

_RATIOS = (0.1, 1.0, 10.0)


class Maxwell(Effect):
    r"""Generalised Maxwell model: three springs, each behind a damper, a decade of time apart.

    .. math:: \Delta F = -\sum_{i=1}^{3} k_i\,(x - x_i), \qquad \tau_i\,\dot x_i = x - x_i, \qquad
        \tau_i = \tfrac{1}{10}\,\tau,\; \tau,\; 10\,\tau

    Parameters
    ----------
    **values : float
        ``fast``, ``middle``, ``slow`` k (N per unit of the position), ``time_constant`` τ of the middle branch (s).
    """

    name = "maxwell"
    family = "viscoelasticity"
    equations = ("force",)
    roles = ("position",)
    kinds = ("actuator", "joint", "motor")
    prior = -4.0  # two springs, creep, are the simpler model
    source = "10.1007/978-3-642-73602-5"
    n_states = len(_RATIOS)
    fastest = min(_RATIOS)
    parameters = (
        Parameter("fast", "N", 0.0, 1e5, 50.0, "stiffness of the fast branch", linear=True, position=-1),
        Parameter("middle", "N", 0.0, 1e5, 50.0, "stiffness of the middle branch", linear=True, position=-1),
        Parameter("slow", "N", 0.0, 1e5, 50.0, "stiffness of the slow branch", linear=True, position=-1),
        Parameter("time_constant", "s", 0.02, 100.0, 0.5, "relaxation time of the middle branch", simplest=True),
    )
    fast: float
    middle: float
    slow: float
    time_constant: float

    @property
    def _taus(self) -> list[float]:
        return [ratio * self.time_constant for ratio in _RATIOS]

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return relaxed branches."""
        return branches_at(s.position, len(_RATIOS))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Relax towards the position."""
        return branches_relax(x, s0.position, s1.position, dt, self._taus)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the branches along each run, without a loop over time."""
        return branches_along(s.position, dt, self._taus, starts)

    def elastic(self, seconds: float) -> bool:
        """Return whether most of the stiffness does not relax."""
        return mostly_lasting((self.fast, self.middle, self.slow), self._taus, seconds)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the three branches, N."""
        stiffness = (self.fast, self.middle, self.slow)
        parts = (k * (s.position - v) for k, v in zip(stiffness, x, strict=True))
        return -sum(parts, start=np.zeros(np.shape(x[0])))

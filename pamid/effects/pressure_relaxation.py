"""Force that lags the pressure, as rubber relaxes."""

from __future__ import annotations

from ..signals.state import Array
from ._memory import branches_along, branches_at, branches_relax
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter

_RATIOS = (1.0, 10.0)


class PressureRelaxation(Effect):
    r"""Bladder and braid that relax for seconds after each change of pressure.

    .. math:: \Delta F = -\sum_{i=1}^{2} (a_i + b_i\,\varepsilon)\,(P - P_i), \qquad \tau_i\,\dot P_i = P - P_i,
        \qquad \tau_2 = 10\,\tau_1

    Parameters
    ----------
    **values : float
        ``fast``, ``slow`` a and their growth with contraction ``fast_growth``, ``slow_growth`` b (N/Pa),
        ``time_constant`` τ₁ (s).
    """

    name = "pressure_relaxation"
    family = "viscoelasticity"
    equations = ("force",)
    roles = ("position", "pressure")
    kinds = ("muscle",)
    source = "10.1007/978-3-642-73602-5"
    n_states = len(_RATIOS)
    parameters = (
        Parameter("fast", "N/Pa", -1e-3, 1e-2, 1e-5, "force that the fast branch holds back", linear=True),
        Parameter("slow", "N/Pa", -1e-3, 1e-2, 0.0, "force that the slow branch holds back", linear=True),
        Parameter("fast_growth", "N/Pa", -1e-2, 1e-2, 0.0, "its growth per contraction", linear=True, position=-1),
        Parameter("slow_growth", "N/Pa", -1e-2, 1e-2, 0.0, "its growth per contraction", linear=True, position=-1),
        Parameter("time_constant", "s", 0.05, 5.0, 0.5, "relaxation time of the fast branch"),
    )
    fast: float
    slow: float
    fast_growth: float
    slow_growth: float
    time_constant: float

    @property
    def _taus(self) -> list[float]:
        return [ratio * self.time_constant for ratio in _RATIOS]

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return branches at rest."""
        return branches_at(s.pressure, len(_RATIOS))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Relax towards the pressure."""
        return branches_relax(x, s0.pressure, s1.pressure, dt, self._taus)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the branches along each run, without a loop over time."""
        return branches_along(s.pressure, dt, self._taus, starts)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return what the branches hold back, N."""
        fast = (self.fast + self.fast_growth * s.position) * (s.pressure - x[0])
        return -fast - (self.slow + self.slow_growth * s.position) * (s.pressure - x[1])

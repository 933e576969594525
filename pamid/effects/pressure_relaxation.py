"""Force that lags the pressure, as rubber relaxes."""

from __future__ import annotations

from ..signals.state import Array
from ._laws import Branches
from .base import Signals
from .plant import Plant
from .values import Parameter


class PressureRelaxation(Branches):
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
    of = "pressure"
    ratios = (1.0, 10.0)
    roles = ("position", "pressure")
    kinds = ("muscle",)
    n_states = 2
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

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the branches, N."""
        fast = (self.fast + self.fast_growth * s.position) * (s.pressure - x[0])
        return -fast - (self.slow + self.slow_growth * s.position) * (s.pressure - x[1])

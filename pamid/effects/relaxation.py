"""Elastic forces that relax with time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from ..signals.state import Array
from ._memory import mostly_lasting, relax, relax_along
from ._places import OnSignal
from .base import Signals
from .plant import Plant
from .values import parameter


class _Branches(OnSignal):
    """Branches that relax towards a signal, some of them slower than the one of the time constant."""

    ratios: ClassVar[tuple[float, ...]]
    """Relaxation times over the time constant."""
    family = "viscoelasticity"
    source = "10.1007/978-3-642-73602-5"
    time_constant: float

    @property
    def taus(self) -> list[float]:
        """Relaxation times, s."""
        return [ratio * self.time_constant for ratio in self.ratios]

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return relaxed branches."""
        return np.stack([self.signal(s) + 0.0] * self.n_states)

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Relax towards the signal."""
        v0, v1 = self.signal(s0), self.signal(s1)
        return np.stack([relax(branch, v0, v1, dt, tau) for branch, tau in zip(x, self.taus, strict=True)])

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the branches along each run, without a loop over time."""
        return np.stack([relax_along(self.signal(s), dt, tau, starts) for tau in self.taus])


class _Springs(_Branches):
    """Springs in series with dampers, which relax towards a position."""

    of = "position"
    roles = ("position",)

    springs: ClassVar[tuple[str, ...]]
    """Names of the parameters that are their stiffnesses."""

    @property
    def stiffnesses(self) -> list[float]:
        """Stiffness of each, N per unit of the position."""
        return [getattr(self, name) for name in self.springs]

    def elastic(self, seconds: float) -> bool:
        """Return whether most of the stiffness does not relax."""
        return mostly_lasting(self.stiffnesses, self.taus, seconds)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the springs, N."""
        parts = (k * (s.position - v) for k, v in zip(self.stiffnesses, x, strict=True))
        return -sum(parts, start=np.zeros(np.shape(x[0])))


class Creep(_Springs):
    r"""Two relaxing springs parallel to the muscle; between their time constants, the force drifts nearly as log t.

    .. math:: \Delta F = -\sum_i k_i\,(\varepsilon - x_i), \qquad \tau_i\,\dot x_i = \varepsilon - x_i

    References
    ----------
    T. V. Minh, T. Tjahjowidodo, H. Ramon, H. Van Brussel, "Cascade position control of a single pneumatic artificial
    muscle-mass system with hysteresis compensation", Mechatronics 20(3), 2010.
    https://doi.org/10.1016/j.mechatronics.2010.01.001
    """

    name = "creep"
    springs = ("stiffness", "slow_stiffness")
    source = "10.1016/j.mechatronics.2010.01.001"
    n_states = 2
    stiffness = parameter("N", 0.0, 1e5, 120.0, "stiffness of the fast spring", linear=True, position=-1, symbol="k₁")
    time_constant = parameter("s", 0.02, 10.0, 1.0, "relaxation time of the fast spring", simplest=True, symbol="τ₁")
    slow_stiffness = parameter(
        "N", 0.0, 1e5, 60.0, "stiffness of the slow spring", linear=True, position=-1, symbol="k₂"
    )
    slow_time_constant = parameter("s", 0.2, 1000.0, 5.0, "relaxation time of the slow spring", symbol="τ₂")
    settled = parameter("-", 0.0, 1.0, 1.0, "how far the springs had relaxed when a run begins", neutral=True)
    unknown = parameter("-", 0.0, 1.0, 0.0, "how much of what was before a run is unknown", before=True)

    @property
    def taus(self) -> list[float]:
        """Relaxation times, s."""
        return [self.time_constant, self.slow_time_constant]

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return springs relaxing from the neutral contraction to the first one."""
        x = self._began(s.position, plant)
        return np.stack([x, x])

    def _began(self, first: Array, plant: Plant) -> Array:
        neutral: float | None = plant.initial_contraction  # an actuator of another kind need not have one
        return first if neutral is None else first + (1.0 - self.settled) * (neutral - first)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the springs' rest positions along each run, without a loop over time."""
        x, rest = np.asarray(s.position, dtype=float), super().trace(s, plant, dt, starts)
        ahead = self._began(x[starts], plant) - x[starts]
        if np.any(ahead):
            run = np.searchsorted(starts, np.arange(len(x)), side="right") - 1
            since = ((np.arange(len(x)) - np.asarray(starts)[run]) * dt).reshape(-1, *[1] * (x.ndim - 1))
            rest += np.stack([ahead[run] * np.exp(-since / tau) for tau in self.taus])
        return rest

    def beginnings(self, spans: Mapping[str, float], plant: Plant) -> tuple[tuple[str, float, float], ...]:
        """Return the decay of each spring from an initial contraction within the range."""
        off = self.unknown * spans.get("position", 0.0)
        springs = zip(self.taus, self.stiffnesses, strict=True)
        return tuple(("force", tau, stiffness * off) for tau, stiffness in springs if stiffness * off > 0.0)


class Maxwell(_Springs):
    r"""Generalised Maxwell model: three springs in series with dampers, their time constants a decade apart.

    .. math:: \Delta F = -\sum_{i=1}^{3} k_i\,(x - x_i), \qquad \tau_i\,\dot x_i = x - x_i, \qquad
        \tau_i = \tfrac{1}{10}\,\tau,\; \tau,\; 10\,\tau
    """

    name = "maxwell"
    springs = ("fast", "middle", "slow")
    ratios = (0.1, 1.0, 10.0)
    kinds = ("actuator", "joint", "motor")
    prior = -4.0  # two springs, creep, are the simpler model
    n_states = 3
    fastest = min(ratios)
    fast = parameter("N", 0.0, 1e5, 50.0, "stiffness of the fast branch", linear=True, position=-1, symbol="k₁")
    middle = parameter("N", 0.0, 1e5, 50.0, "stiffness of the middle branch", linear=True, position=-1, symbol="k₂")
    slow = parameter("N", 0.0, 1e5, 50.0, "stiffness of the slow branch", linear=True, position=-1, symbol="k₃")
    time_constant = parameter("s", 0.02, 100.0, 0.5, "relaxation time of the middle branch", simplest=True, symbol="τ")


class PressureRelaxation(_Branches):
    r"""Bladder and braid that relax for seconds after each change of pressure.

    .. math:: \Delta F = -\sum_{i=1}^{2} (a_i + b_i\,\varepsilon)\,(P - P_i), \qquad \tau_i\,\dot P_i = P - P_i,
        \qquad \tau_2 = 10\,\tau_1
    """

    name = "pressure_relaxation"
    of = "pressure"
    ratios = (1.0, 10.0)
    roles = ("position", "pressure")
    kinds = ("muscle",)
    n_states = 2
    fast = parameter("N/Pa", -1e-3, 1e-2, 1e-5, "force that the fast branch holds back", linear=True, symbol="a₁")
    slow = parameter("N/Pa", -1e-3, 1e-2, 0.0, "force that the slow branch holds back", linear=True, symbol="a₂")
    fast_growth = parameter(
        "N/Pa", -1e-2, 1e-2, 0.0, "its growth per contraction", linear=True, position=-1, symbol="b₁"
    )
    slow_growth = parameter(
        "N/Pa", -1e-2, 1e-2, 0.0, "its growth per contraction", linear=True, position=-1, symbol="b₂"
    )
    time_constant = parameter("s", 0.05, 5.0, 0.5, "relaxation time of the fast branch", symbol="τ₁")

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the branches, N."""
        fast = (self.fast + self.fast_growth * s.position) * (s.pressure - x[0])
        return -fast - (self.slow + self.slow_growth * s.position) * (s.pressure - x[1])

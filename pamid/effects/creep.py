"""Slow relaxation of rubber and braid."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..signals.state import Array
from ._memory import mostly_lasting, relax, relax_along
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class Creep(Effect):
    r"""Two relaxing springs parallel to the muscle; between their time constants, the force drifts nearly as log t.

    .. math:: \Delta F = -\sum_i k_i\,(\varepsilon - x_i), \qquad \tau_i\,\dot x_i = \varepsilon - x_i

    Parameters
    ----------
    **values : float
        ``stiffness`` k₁ (N) and ``time_constant`` τ₁ (s) of the fast spring, ``slow_stiffness`` k₂ (N) and
        ``slow_time_constant`` τ₂ (s) of the slow one; ``settled``, how far both had relaxed from the neutral
        contraction to the first one when a run begins; ``unknown``, by how much of the range of contraction their start
        is unknown in each run (dimensionless; only for logs, a simulation knows it).

    References
    ----------
    T. V. Minh, T. Tjahjowidodo, H. Ramon, H. Van Brussel, "Cascade position control of a single pneumatic artificial
    muscle-mass system with hysteresis compensation", Mechatronics 20(3), 2010.
    https://doi.org/10.1016/j.mechatronics.2010.01.001
    """

    name = "creep"
    family = "viscoelasticity"
    equations = ("force",)
    roles = ("position",)
    source = "10.1016/j.mechatronics.2010.01.001"
    n_states = 2
    parameters = (
        Parameter("stiffness", "N", 0.0, 1e5, 120.0, "stiffness of the fast spring", linear=True, position=-1),
        Parameter("time_constant", "s", 0.02, 10.0, 1.0, "relaxation time of the fast spring", simplest=True),
        Parameter("slow_stiffness", "N", 0.0, 1e5, 60.0, "stiffness of the slow spring", linear=True, position=-1),
        Parameter("slow_time_constant", "s", 0.2, 1000.0, 5.0, "relaxation time of the slow spring"),
        Parameter("settled", "-", 0.0, 1.0, 1.0, "how far the springs had relaxed when a run begins", neutral=True),
        Parameter("unknown", "-", 0.0, 1.0, 0.0, "how much of what was before a run is unknown", before=True),
    )
    stiffness: float
    time_constant: float
    slow_stiffness: float
    slow_time_constant: float
    settled: float
    unknown: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return springs relaxing from the neutral contraction to the first one."""
        x = self._began(s.position, plant)
        return np.stack([x, x])

    def _began(self, first: Array, plant: Plant) -> Array:
        neutral: float | None = plant.initial_contraction  # an actuator of another kind need not have one
        return first if neutral is None else first + (1.0 - self.settled) * (neutral - first)

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Relax towards the contraction."""
        v0, v1 = s0.position, s1.position
        return np.stack([relax(x[0], v0, v1, dt, self.time_constant), relax(x[1], v0, v1, dt, self.slow_time_constant)])

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the springs' rest positions along each run, without a loop over time."""
        x, taus = np.asarray(s.position, dtype=float), (self.time_constant, self.slow_time_constant)
        rest = np.stack([relax_along(x, dt, tau, starts) for tau in taus])
        ahead = self._began(x[starts], plant) - x[starts]
        if np.any(ahead):
            run = np.searchsorted(starts, np.arange(len(x)), side="right") - 1
            since = ((np.arange(len(x)) - np.asarray(starts)[run]) * dt).reshape(-1, *[1] * (x.ndim - 1))
            rest += np.stack([ahead[run] * np.exp(-since / tau) for tau in taus])
        return rest

    def beginnings(self, spans: Mapping[str, float], plant: Plant) -> tuple[tuple[str, float, float], ...]:
        """Return the decay of each spring from an initial contraction within the range."""
        off = self.unknown * spans.get("position", 0.0)
        springs = (self.time_constant, self.stiffness), (self.slow_time_constant, self.slow_stiffness)
        return tuple(("force", tau, stiffness * off) for tau, stiffness in springs if stiffness * off > 0.0)

    def elastic(self, seconds: float) -> bool:
        """Return whether most of the stiffness does not relax."""
        stiffness = (self.stiffness, self.slow_stiffness)
        return mostly_lasting(stiffness, (self.time_constant, self.slow_time_constant), seconds)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of both springs, N."""
        return -self.stiffness * (s.position - x[0]) - self.slow_stiffness * (s.position - x[1])

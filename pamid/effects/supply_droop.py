"""A supply whose pressure falls when it is drawn from."""

from __future__ import annotations

import numpy as np

from ..laws.valve import flow_function
from ..signals.state import Array
from ._memory import drawn_along
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter

_ROUNDS, _CLOSE = 40, 1e-12
"""Most rounds in which the flow and the pressure that it is drawn from are brought together, and when they are, as a
share of the supply pressure."""


class SupplyDroop(Effect):
    r"""Receiver behind a regulator, and a hose to each valve: the inlet pressure falls with the flow drawn.

    .. math:: P_s' = \frac{P_s - d}{1 + R_s k}, \qquad \tau\,\dot d = R_r \sum k\,P_s' - d, \qquad
        k = C\,u^+ \rho_0\,\psi\big(P/(P_s - d)\big)

    A valve draws the flow :math:`k P_s'`; the receiver feeds the valves of all muscles. The hose answers at once, the
    regulator lets the receiver recover in its time.

    Parameters
    ----------
    **values : float
        ``resistance`` R_s of the hose and ``regulation`` R_r, by how much the receiver falls in the end (Pa s/kg),
        and the receiver's ``time_constant`` τ (s).

    References
    ----------
    ISO 6358-1:2013, "Pneumatic fluid power - Determination of flow-rate characteristics of components using
    compressible fluids"; ISO 6953-1:2015, "Pneumatic fluid power - Compressed air pressure regulators and
    filter-regulators", for the fall of a regulator's pressure with its flow.
    """

    name = "supply_droop"
    family = "valve"
    equations = ("valve",)
    roles = ("command", "pressure")
    source = "ISO 6358-1:2013, ISO 6953-1:2015"
    n_states = 1
    parameters = (
        Parameter("resistance", "Pa s/kg", 0.0, 1e10, 2e7, "pressure lost in the hose per flow drawn", linear=True),
        Parameter("regulation", "Pa s/kg", 0.0, 1e10, 0.0, "fall of the regulated pressure per flow", linear=True),
        Parameter("time_constant", "s", 1e-3, 5.0, 0.05, "time in which the receiver empties and recovers"),
    )
    resistance: float
    regulation: float
    time_constant: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a full receiver."""
        return np.zeros((1, *np.shape(s.command)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the pressure at which the regulator replaces what the held command draws."""
        settled, rate = self._settling(x[0], s0.command, 0.5 * (s0.pressure + s1.pressure), plant, 0)
        return (settled + (x[0] - settled) * np.exp(-dt * rate))[None]

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the fall of the receiver's pressure along each run, without a loop over time."""
        u, P = np.asarray(s.command, dtype=float), np.asarray(s.pressure, dtype=float)
        d = np.zeros_like(u)
        if self.regulation == 0.0:
            return d[None]
        between = 0.5 * (P[:-1] + P[1:])
        for k in range(_ROUNDS):
            before, (settled, rate) = d, self._settling(d[:-1], u[:-1], between, plant, 1)
            d = drawn_along(settled, np.exp(-dt * rate), starts)
            if (
                k > _ROUNDS // 4
            ):  # near the pressure of the muscle the flow changes abruptly, and rounds go back and forth
                d = 0.5 * (d + before)
            if np.max(np.abs(d - before), initial=0.0) < _CLOSE * plant.supply_pressure:
                break
        return d[None]

    def supply(self, P_supply: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the pressure at the inlet, Pa."""
        k = self._conductance(s.command, s.pressure, P_supply - x[0], plant)
        return (P_supply - x[0]) / (1.0 + self.resistance * k)

    @staticmethod
    def _conductance(u: Array, P: Array, inlet: Array, plant: Plant) -> Array:
        """Return the flow that the valve draws per pressure at its inlet, kg/(s Pa)."""
        psi = flow_function(P / inlet, plant.critical_pressure_ratio)
        return np.asarray(plant.sonic_conductance * plant.reference_density * np.maximum(u, 0.0) * psi)

    def _settling(self, d: Array, u: Array, P: Array, plant: Plant, muscles: int) -> tuple[Array, Array]:
        """Return the final fall of pressure under held commands (Pa) and its rate (1/s), muscles along an axis."""
        k = self._conductance(u, P, plant.supply_pressure - d, plant)
        k = k / (1.0 + self.resistance * k)
        if k.ndim > muscles:
            k = np.broadcast_to(k.sum(axis=muscles, keepdims=True), k.shape)
        drawn = self.regulation * k
        return drawn / (1.0 + drawn) * plant.supply_pressure, (1.0 + drawn) / self.time_constant

"""Heat transfer from the gas to the walls."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..signals.recursion import recursive
from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class HeatTransfer(Effect):
    r"""Gas that warms when compressed and cools at the walls: adiabatic when fast, isothermal when slow.

    By the first law, with inflow at the temperature T of the walls and outflow at the gas's own, a muscle holds less
    gas by E than it would at that temperature,

    .. math:: \Delta\dot m = E\left(\frac{1}{\tau_P} + \kappa\,\omega\right), \qquad
        \dot E = \frac{\gamma - 1}{\gamma}\,\frac{V \dot P}{R T} - E\left(\frac{1}{\tau_P} +
        \kappa\,\omega\right), \qquad
        \omega = \max\left(0, -\frac{\dot P}{P} - \frac{\dot V}{V}\right), \qquad
        \tau_P = \tau \Big(\frac{P}{3\,P_a}\Big)^{\varsigma}

    for an excess of temperature E T/m that is small beside T. Gas that leaves, a share ω of it per second, takes its
    excess along: all of it (κ = 1), or less where it passes a hose at the temperature of the walls. With ς = 0 denser
    gas gives off more heat; with ς = 1 the conductance of the walls is constant, and more gas takes longer to cool.

    Parameters
    ----------
    **values : float
        ``time_constant`` τ at constant pressure, at three times that of the surroundings (s); ``slowing`` ς;
        ``carried`` κ; ``unknown``, how much of the range of pressure may have been passed shortly before each run
        (dimensionless; only for logs, a simulation knows it).
    """

    name = "heat_transfer"
    family = "gas"
    equations = ("flow",)
    roles = ("position", "velocity", "pressure", "pressure_rate")
    source = "10.1115/1.1286336"
    n_states = 1
    parameters = (
        Parameter("time_constant", "s", 1e-3, 1e4, 0.2, "time constant of the cooling"),
        Parameter("slowing", "-", 0.0, 1.0, 0.0, "power with which the time constant grows with the pressure"),
        Parameter("carried", "-", 0.0, 1.0, 1.0, "share of its excess of temperature with which gas leaves"),
        Parameter("unknown", "-", 0.0, 1.0, 0.0, "how much of what was before a run is unknown", before=True),
    )
    time_constant: float
    slowing: float
    carried: float
    unknown: float

    def _rate(self, P: Array, plant: Plant) -> Array:
        """Return one over the time constant, 1/s."""
        return np.power(3.0 * plant.atmospheric_pressure / P, self.slowing) / self.time_constant

    def _gained(self, P0: Array, P1: Array, V: Array, plant: Plant) -> Array:
        """Return the missing gas that an adiabatic change of pressure adds, kg."""
        g = plant.heat_capacity_ratio
        return (g - 1.0) / g * V * (P1 - P0) / plant.RT

    def _lost(self, P0: Array, P1: Array, V0: Array, V1: Array, dt: float, plant: Plant) -> Array:
        """Return the logarithmic decrease of the excess by cooling and leaving gas over an interval."""
        left = self.carried * np.maximum(0.0, -np.log((P1 * V1) / (P0 * V0)))
        return dt * self._rate(0.5 * (P0 + P1), plant) + left

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return gas at the temperature of the walls: nothing is missing."""
        return np.stack([0.0 * s.pressure])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Warm by compression, cool towards the walls."""
        V0, V1 = plant.volume(s0.position), plant.volume(s1.position)
        r = self._lost(s0.pressure, s1.pressure, V0, V1, dt, plant)
        return x * np.exp(-r) + self._gained(s0.pressure, s1.pressure, 0.5 * (V0 + V1), plant) * _mean_decay(r)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the missing gas along each run, without a loop over time."""
        P, V = np.asarray(s.pressure, dtype=float), np.asarray(plant.volume(s.position), dtype=float)
        drive, decay = np.zeros_like(P), np.zeros_like(P)
        r = self._lost(P[:-1], P[1:], V[:-1], V[1:], dt, plant)
        drive[1:] = self._gained(P[:-1], P[1:], 0.5 * (V[:-1] + V[1:]), plant) * _mean_decay(r)
        decay[1:] = np.exp(-r)
        drive[starts] = 0.0
        return _along(drive, decay, starts)[None]

    def beginnings(self, spans: Mapping[str, float], plant: Plant) -> tuple[tuple[str, float, float], ...]:
        """Return the decay of gas compressed or expanded from an initial pressure within the range."""
        volume = float(max(plant.volume(0.0), plant.volume(spans.get("position", 0.0))))
        missing = float(self._gained(0.0, spans.get("pressure", 0.0), volume, plant))
        size = self.unknown * missing / self.time_constant
        return (("flow", self.time_constant, size),) if size > 0.0 else ()

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow due to cooling, less that displaced by warm gas, kg/s."""
        widening = plant.volume_slope(s.position) * s.velocity / plant.volume(s.position)
        rate = s.pressure_rate / s.pressure + widening if s.flow is None else s.flow
        leaving = np.where(rate < 0.0, self.carried * x[0], 0.0)
        return FlowTerm(x[0] * self._rate(s.pressure, plant) - leaving * widening, -leaving / s.pressure)


def _mean_decay(r: Array) -> Array:
    """Return the mean of exp(−r t) for t from 0 to 1."""
    return -np.expm1(-r) / np.maximum(r, 1e-300)


def _along(drive: Array, decay: Array, starts: Array) -> Array:
    """Return the recursion of each column by its own decay."""
    if drive.ndim == 1:
        return recursive(drive, [decay], starts)
    return np.stack([recursive(drive[:, k], [decay[:, k]], starts) for k in range(drive.shape[1])], axis=1)

"""What follows its input with a lag: the reading of a sensor, the spool of a valve."""

from __future__ import annotations

import numpy as np

from ..signals.recursion import recursive
from ..signals.state import Array
from ._memory import carried, carried_along, hold_along, relax, relax_along, unlagged
from ._places import OfCommand, OfFlow, OfForce, OfPressure, OnSignal
from .base import Signals
from .plant import Plant
from .values import parameter

SECOND = parameter("-", 0.0, 1.0, 0.0, "second lag as a share of the first")


class _Lag(OnSignal):
    r"""A reading that follows with a lag, of second order with a second one.

    .. math:: \tau_1\,\frac{\mathrm{d}x}{\mathrm{d}t} = y - x, \qquad
        \tau_2\,\frac{\mathrm{d}y'}{\mathrm{d}t} = x - y', \qquad
        \tau_1 + \tau_2 = \tau, \qquad \tau_2 = s\,\tau_1

    with the true value y, the reading y', the time constant τ and the second lag s as a share of the first: 0 for a lag
    of first order.
    """

    time_constant: float
    second: float
    n_states = 2
    sampled = True

    def _lags(self) -> tuple[float, float]:
        first = self.time_constant / (1.0 + self.second)
        return first, self.second * first

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a settled sensor."""
        return np.stack([self.signal(s) + 0.0] * 2)

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Follow the value."""
        first, second = self._lags()
        middle = relax(x[0], self.signal(s0), self.signal(s1), dt, first)
        return np.stack([middle, relax(x[1], x[0], middle, dt, second) if second > 0.0 else middle])

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return both lags along each run, without a loop over time."""
        first, second = self._lags()
        middle = relax_along(self.signal(s), dt, first, starts)
        return np.stack([middle, relax_along(middle, dt, second, starts) if second > 0.0 else middle])

    def measure(self, value: Array, x: Array) -> Array:
        """Return the lagging reading."""
        return x[1]

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return reading + (τ₁ + τ₂) · its rate + τ₁ τ₂ · its curvature; noise is amplified by about τ/dt."""
        first, second = self._lags()
        return unlagged(reading, dt, first + second, first * second, starts)


class PressureLag(_Lag, OfPressure):
    """A pressure sensor that lags."""

    name = "pressure_lag"
    time_constant = parameter("s", 1e-4, 0.5, 0.01, "time constant of sensor and tube")
    second = SECOND


class ForceLag(_Lag, OfForce):
    """A load cell behind a slow amplifier."""

    name = "force_lag"
    time_constant = parameter("s", 1e-4, 0.5, 0.01, "time constant of the sensor")
    second = SECOND


class FlowLag(_Lag, OfFlow):
    """A flow meter that lags."""

    name = "flow_lag"
    time_constant = parameter("s", 1e-4, 0.5, 0.01, "time constant of the meter")
    second = SECOND


class Tube(OfPressure):
    r"""Tube between the muscle and a sensor at the valve: the pressure in the muscle lags behind the reading.

    .. math:: P' = P + \tau\,\dot P, \qquad \tau = R\,C

    with the pressure P in the chamber and the reading P'.
    """

    name = "tube"
    equations = ("force", "flow")
    kinds = ("muscle", "actuator")
    source = "10.1115/1.1286336"
    n_states = 2
    sampled = True
    time_constant = parameter("s", 1e-4, 0.5, 0.015, "resistance of the tube times the capacity")

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a chamber at rest: its pressure and the rate of it."""
        P = np.array(s.pressure, dtype=float)
        return np.stack([P, np.zeros_like(P)])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Take in the pressure of the later instant and its rate since the earlier one."""
        return np.stack([s1.pressure + 0.0 * x[0], (s1.pressure - s0.pressure) / dt + 0.0 * x[0]])

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return pressure and rate along each run, without a loop over time."""
        P = np.asarray(s.pressure, dtype=float)
        rate = np.diff(P, axis=0, prepend=P[:1]) / dt
        rate[np.asarray(starts)] = 0.0
        return np.stack([P, rate])

    def measure(self, value: Array, x: Array) -> Array:
        """Return the pressure at the other end of the tube, Pa."""
        return value + self.time_constant * x[1]

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the pressure in the chamber behind a reading: its first-order lag."""
        reading, share = np.asarray(reading, dtype=float), self.time_constant / dt
        drive = reading / (1.0 + share)
        drive[starts] = reading[starts]
        return recursive(drive, [share / (1.0 + share)], starts)

    def restore_next(self, before: Array, reading: Array, dt: Array) -> Array:
        """Return the pressure in the chamber from the one before: a step of its first-order lag."""
        return (dt * reading + self.time_constant * before) / (dt + self.time_constant)


_LEAST = 1e-4
"""Inertia below which a spool counts as massless: its second time constant is that small a share of the first."""


class ValveLag(OfCommand):
    r"""Lag of the spool behind the command; second order if the spool has inertia.

    .. math:: s\,\tau^2\,\ddot y + \tau\,\dot y = u - y, \qquad u' = y

    The command is held for a control period. With s = 0 it is a lag of first order, with s = 1/4 two alike
    concatenated; above that the spool swings about its command, with a damping ratio of :math:`1/(2\sqrt{s})`. By τ it
    comes late in any case.
    """

    name = "valve_lag"
    source = "10.1115/1.1286336"
    n_states = 2
    time_constant = parameter("s", 1e-4, 0.5, 0.01, "time constant of what follows the command", symbol="τ", points=6)
    second = parameter("-", 0.0, 1.0, 0.0, "inertia: 0.25 for two lags alike, above it swings", symbol="s")

    def _spring(self) -> tuple[float, float]:
        """Return natural frequency (rad/s) and damping ratio."""
        root = float(np.sqrt(self.second))
        return 1.0 / (self.time_constant * root), 0.5 / root

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a spool at rest at its command: its position and its speed."""
        u = np.array(s.command, dtype=float)
        return np.stack([u, 0.0 * u])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the command that is held from the first instant on."""
        u = s0.command
        if self.second < _LEAST:
            return np.stack([u + (x[0] - u) * np.exp(-dt / self.time_constant), 0.0 * x[0]])
        return carried(x, u, u, *self._spring(), dt, ramp=False)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the spool's position and speed along each run, without a loop over time."""
        if self.second < _LEAST:
            y = hold_along(s.command, dt, self.time_constant, starts)
            return np.stack([y, 0.0 * y])
        return carried_along(s.command, dt, *self._spring(), starts, ramp=False)

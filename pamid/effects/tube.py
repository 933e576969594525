"""A tube between the pressure sensor and the muscle."""

from __future__ import annotations

import numpy as np

from ..signals.recursion import recursive
from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class Tube(Effect):
    r"""Tube from a sensor at the valve to the muscle: the pressure in the muscle lags behind the reading.

    .. math:: P' = P + \tau\,\dot P, \qquad \tau = R\,C

    with the pressure P in the chamber and the reading P'.
    """

    name = "tube"
    family = "sensor"
    equations = ("force", "flow")
    roles = ("pressure",)
    channel = "P"
    kinds = ("muscle", "actuator")
    source = "10.1115/1.1286336"
    n_states = 2
    sampled = True
    parameters = (Parameter("time_constant", "s", 1e-4, 0.5, 0.015, "resistance of the tube times the capacity"),)
    time_constant: float

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

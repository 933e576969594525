"""What sensor faults share: a channel, its reading from the true value, and the true value from readings."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..signals.state import ROLES, Array
from ._delay import delayed_rows, memory, shift
from ._memory import relax, relax_along
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter

ROLE = {channel: ROLES[channel] for channel in ("q", "P", "F", "mdot")}
"""The role in which each channel's true value reaches a sensor's memory."""


class SensorFault(Effect):
    """A fault of a sensor."""

    family = "sensor"
    source = "10.1007/3-540-30368-5"


class OfForce(SensorFault):
    """Of a load cell."""

    equations = ("force", "joint")
    channel = "F"
    roles = ("force",)


class OfFlow(SensorFault):
    """Of a flow meter."""

    equations = ("flow", "valve")
    channel = "mdot"
    roles = ("flow",)


class OfPressure(SensorFault):
    """Of a pressure sensor."""

    equations = ("force", "flow", "valve")
    channel = "P"
    roles = ("pressure",)


class OfAngle(SensorFault):
    """Of an encoder."""

    equations = ("force", "flow", "joint")
    channel = "q"
    site = "joint"
    roles = ("position",)


SECOND = Parameter("second", "-", 0.0, 1.0, 0.0, "second lag as a share of the first")


class Bias(SensorFault):
    """A constant added to every reading: parameter ``offset``."""

    offset: float

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value plus the offset."""
        return value + self.offset

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the reading less the offset."""
        return self.restore_next(reading, reading, np.asarray(dt))

    def restore_next(self, before: Array, reading: Array, dt: Array) -> Array:
        """Return the reading less the offset."""
        return reading - self.offset


class Gain(SensorFault):
    """Every reading too large or too small by a factor: parameter ``deviation``."""

    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("deviation", "-", -0.5, 0.5, 0.02, "relative deviation of the reading", linear=True),
    )
    deviation: float
    zero: float = 0.0

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value times 1 + deviation, about the zero of the sensor."""
        return value + self.deviation * (value - self.zero)

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the value behind the reading."""
        return self.restore_next(reading, reading, np.asarray(dt))

    def restore_next(self, before: Array, reading: Array, dt: Array) -> Array:
        """Return the value behind the reading."""
        return (reading + self.deviation * self.zero) / (1.0 + self.deviation)


class Lag(SensorFault):
    """A reading that follows with a lag, of second order with a second one: ``time_constant``, ``second``."""

    time_constant: float
    second: float
    n_states = 2
    sampled = True

    def _lags(self) -> tuple[float, float]:
        first = self.time_constant / (1.0 + self.second)
        return first, self.second * first

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a settled sensor."""
        value = np.array(getattr(s, ROLE[self.channel]), dtype=float)
        return np.stack([value, value])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Follow the value."""
        role, (first, second) = ROLE[self.channel], self._lags()
        middle = relax(x[0], getattr(s0, role), getattr(s1, role), dt, first)
        return np.stack([middle, relax(x[1], x[0], middle, dt, second) if second > 0.0 else middle])

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return both lags along each run, without a loop over time."""
        first, second = self._lags()
        middle = relax_along(getattr(s, ROLE[self.channel]), dt, first, starts)
        return np.stack([middle, relax_along(middle, dt, second, starts) if second > 0.0 else middle])

    def measure(self, value: Array, x: Array) -> Array:
        """Return the lagging reading."""
        return x[1]

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return reading + (τ₁ + τ₂) · its rate + τ₁ τ₂ · its curvature; noise is amplified by about τ/dt."""
        out, (first, second) = np.array(reading, dtype=float), self._lags()
        ends = [*list(starts)[1:], len(out)]
        for a, b in zip(starts, ends, strict=True):
            if b - a > 1:
                rate = np.gradient(out[a:b], dt, axis=0)
                bend = first * second * np.gradient(rate, dt, axis=0) if second > 0.0 else 0.0
                out[a:b] += (first + second) * rate + bend
        return out


class Delay(SensorFault):
    """A reading that comes late: parameter ``delay``."""

    delay: float
    n_states = 1
    sampled = True

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return equal past values; the first entry is the reading."""
        value = np.asarray(getattr(s, ROLE[self.channel]), dtype=float)
        return np.broadcast_to(value, (1 + memory(self.delay / dt), *value.shape)).copy()

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Take in the value of the later instant."""
        return shift(x, getattr(s1, ROLE[self.channel]), self.delay / dt, smooth=True)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the delayed value along each run, without a loop over time."""
        value = np.asarray(getattr(s, ROLE[self.channel]), dtype=float)
        return delayed_rows(value, self.delay / dt, starts, smooth=True)[None]

    def measure(self, value: Array, x: Array) -> Array:
        """Return the late reading."""
        return x[0]

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the readings moved back in time."""
        return delayed_rows(np.asarray(reading, dtype=float), -self.delay / dt, starts, smooth=True)

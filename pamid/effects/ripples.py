"""Readings with an error that repeats along the way."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._places import Invertible, OfAngle
from .values import parameter

_STEPS = 8
"""Steps of Newton's method: an error that leaves the reading in order is undone to rounding."""
_STEEP = 0.1
"""Least slope of the reading that they take: below it, readings do not say where they come from."""


class PeriodicReading(Invertible, OfAngle):
    r"""An eccentric encoder disc, the pitch of a scale or screw, an interpolator out of tune.

    .. math:: q' = q + a\,\sin(n q) + b\,\cos(n q)
    """

    sine = parameter("rad", -10.0, 10.0, 0.1, "amplitude of the sine", linear=True, symbol="a")
    cosine = parameter("rad", -10.0, 10.0, 0.0, "amplitude of the cosine", linear=True, symbol="b")
    rate = parameter("1/rad", 1e-2, 1e6, 10.0, "periods in 2π of the position", periods=True, position=-1, symbol="n")

    def measure(self, value: Array, x: Array) -> Array:
        """Return q + a sin(n q) + b cos(n q)."""
        return value + self.sine * np.sin(self.rate * value) + self.cosine * np.cos(self.rate * value)

    def restore_next(self, before: Array, reading: Array, dt: Array) -> Array:
        """Return the position behind a reading, by Newton's method."""
        value = reading = np.asarray(reading, dtype=float)
        for _ in range(_STEPS):
            sine, cosine = np.sin(self.rate * value), np.cos(self.rate * value)
            slope = 1.0 + self.rate * (self.sine * cosine - self.cosine * sine)
            value = value - (value + self.sine * sine + self.cosine * cosine - reading) / np.maximum(slope, _STEEP)
        return value

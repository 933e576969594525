"""What comes late as a whole, by samples or parts of them, in a simulation and along a log."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..signals.state import Array
from ._memory import delayed_rows, memory, shift
from ._places import OfAngle, OfCommand, OnSignal
from .base import Signals
from .plant import Plant
from .values import parameter


class _Delay(OnSignal):
    """What comes late by a ``delay``, interpolated between samples as smooth or as held."""

    smooth: ClassVar[bool]
    delay: float
    n_states = 1
    sampled = True

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return equal past values; the first entry is the output."""
        value, past = self.signal(s) + 0.0, memory(self.delay / dt, self.smooth)
        return np.broadcast_to(value, (1 + past, *np.shape(value))).copy()

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Take in the value of the later instant."""
        return shift(x, self.signal(s1), self.delay / dt, self.smooth)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the delayed value along each run, without a loop over time."""
        return delayed_rows(self.signal(s), self.delay / dt, starts, self.smooth)[None]


class TransportDelay(_Delay, OfCommand):
    r"""Delay between command and valve, from electronics or a bus.

    .. math:: u'(t) = u(t - d)

    The command is held over a control period; a delay of a part of a period passes the mean of the two commands that
    share the period.
    """

    name = "transport_delay"
    source = "10.1115/1.1286336"
    smooth = False
    delay = parameter("s", 0.0, 1.0, 0.008, "time from the command to its effect")


class AngleDelay(_Delay, OfAngle):
    r"""An encoder whose readings come late.

    .. math:: q'(t) = q(t - d)
    """

    name = "angle_delay"
    smooth = True
    delay = parameter("s", 0.0, 1.0, 0.005, "age of the reading")

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the readings moved back in time."""
        return delayed_rows(reading, -self.delay / dt, starts, self.smooth)

"""What comes late as a whole, by samples or parts of them, in a simulation and along a log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..signals.state import Array
from ._places import OfAngle, OfCommand, OnSignal
from .base import Signals
from .plant import Plant
from .values import parameter


def cubic(x: float, nodes: Sequence[int]) -> list[float]:
    """Return the weights of four samples in the value between them: the cubic polynomial through them."""
    return [math.prod((x - b) / (a - b) for b in nodes if b != a) for a in nodes]


def memory(samples: float, smooth: bool = True) -> int:
    """Return how many past values `shift` needs, besides the output."""
    return max(math.ceil(samples) + 2, 4) if smooth else math.ceil(samples) + 1


def shift(x: Array, value: Array, samples: float, smooth: bool = False) -> Array:
    """Push ``value`` into the memory (entry 0: output, entries 1…: newest first) and update the output."""
    out = np.empty_like(x)
    out[1] = value
    out[2:] = x[1:-1]
    whole = math.floor(samples)
    part = samples - whole
    out[0] = out[1 + whole]
    if part > 0.0 and smooth:
        nodes = range(first := max(whole - 1, 0), first + 4)  # nothing is newer than the newest
        out[0] = sum(w * out[1 + k] for w, k in zip(cubic(samples, nodes), nodes, strict=True))
    elif part > 0.0:
        out[0] += part * (out[2 + whole] - out[1 + whole])
    return out


def delayed_rows(v: Array, samples: float, starts: Array, smooth: bool = False) -> Array:
    """Return ``v`` delayed (or advanced) within each run; ends repeat, smooth signals are interpolated cubically."""
    v, n = np.asarray(v, dtype=float), len(v)
    starts = np.asarray(starts, dtype=np.int64)
    lengths = np.diff(np.append(starts, n))
    first = np.repeat(starts, lengths)
    last = np.repeat(starts + lengths - 1, lengths)
    whole = math.floor(samples)
    part = samples - whole
    rows = np.arange(n)

    def at(k: int) -> Array:
        return v[np.clip(rows - whole - k, first, last)]

    if part == 0.0:
        return at(0)
    if smooth:
        return np.asarray(sum(w * at(k) for w, k in zip(cubic(part, range(-1, 3)), range(-1, 3), strict=True)))
    return at(0) + part * (at(1) - at(0))


class Delay(OnSignal):
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


class TransportDelay(Delay, OfCommand):
    r"""Delay between command and valve, from electronics or a bus.

    .. math:: u'(t) = u(t - d)

    The command is held over a control period; a delay of a part of a period passes the mean of the two commands that
    share the period.
    """

    name = "transport_delay"
    source = "10.1115/1.1286336"
    smooth = False
    delay = parameter("s", 0.0, 0.2, 0.008, "time from the command to its effect")


class AngleDelay(Delay, OfAngle):
    r"""An encoder whose readings come late.

    .. math:: q'(t) = q(t - d)
    """

    name = "angle_delay"
    smooth = True
    delay = parameter("s", 0.0, 0.2, 0.005, "age of the reading")

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the readings moved back in time."""
        return delayed_rows(reading, -self.delay / dt, starts, self.smooth)

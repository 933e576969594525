"""A command that arrives late."""

from __future__ import annotations

import math

import numpy as np

from ..signals.state import Array
from ._delay import delayed_rows, shift
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class TransportDelay(Effect):
    r"""Delay between command and valve, from electronics or a bus.

    .. math:: u'(t) = u(t - d)

    The command is held over a control period; a delay of a part of a period passes the mean of the two commands that
    share the period.
    """

    name = "transport_delay"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    n_states = 1
    sampled = True
    parameters = (Parameter("delay", "s", 0.0, 0.2, 0.008, "time from the command to its effect"),)
    delay: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the past commands within the delay; the valve receives the first one."""
        n = math.ceil(self.delay / dt) + 1
        return np.broadcast_to(np.asarray(s.command, dtype=float), (n + 1, *np.shape(s.command))).copy()

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Take in the command of the later instant."""
        return shift(x, s1.command, self.delay / dt)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the delayed command along each run, without a loop over time."""
        return delayed_rows(np.asarray(s.command, dtype=float), self.delay / dt, starts)[None]

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the delayed command."""
        return x[0]

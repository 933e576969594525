"""A command that is followed at a limited speed."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class SlewRate(Effect):
    r"""Largest speed at which a drive, a valve or an amplifier follows its command.

    .. math:: \dot u' = r\,\operatorname{sgn}(u - u')

    The command is updated once per control period.

    References
    ----------
    G. Stein, "Respect the unstable", IEEE Control Systems Magazine 23(4), 2003.
    https://doi.org/10.1109/MCS.2003.1213600
    """

    name = "slew_rate"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    kinds = ("bench", "motor")
    prior = -2.0  # a lag is the simpler model
    source = "10.1109/MCS.2003.1213600"
    n_states = 1
    sampled = True
    parameters = (Parameter("rate", "1/s", 1e-2, 1e4, 2.0, "full commands that are passed in a second"),)
    rate: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a settled output."""
        return np.stack([np.array(s.command, dtype=float)])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the command of the later instant."""
        return x + np.clip(s1.command - x, -self.rate * dt, self.rate * dt)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the output along each run."""
        u = np.asarray(s.command, dtype=float)
        lanes = u.reshape(len(u), -1).T
        return np.stack([_followed(lane, self.rate * dt, starts) for lane in lanes], axis=-1).reshape(1, *u.shape)

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the output."""
        return x[0]


def _followed(u: Array, most: float, starts: Array) -> Array:
    """Return the rate-limited output of one command; plain numbers are fastest in a loop."""
    out = np.empty_like(u)
    for begin, end in itertools.pairwise([*np.asarray(starts).tolist(), len(u)]):
        path, x = [], float(u[begin])
        for target in u[begin:end].tolist():
            x = target if abs(target - x) <= most else x + math.copysign(most, target - x)
            path.append(x)
        out[begin:end] = path
    return out

"""Rate-independent hysteresis between the command and the actuator's motion."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._stop import RATIOS, stopped, stops_along, stops_at
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class ActuatorHysteresis(Effect):
    r"""Prandtl–Ishlinskii operator in the command: a piezo or a magnet lags behind its drive at any speed.

    .. math:: u' = u - \sum_{i=1}^{3} w_i\, r_i\, z_i, \qquad
        z_i = \frac{u - \mathrm{play}_{r_i}(u)}{r_i}, \qquad r_i = \tfrac{1}{3}\,r,\; r,\; 3\,r

    with elastic stops z in [−1, 1].

    Parameters
    ----------
    **values : float
        ``narrow``, ``middle``, ``wide`` w (share of a change of the command that is held back until the stop slips),
        ``width`` r of the middle stop (unit of the command).
    """

    name = "actuator_hysteresis"
    family = "hysteresis"
    equations = ("valve",)
    roles = ("command",)
    kinds = ("motor",)
    prior = -2.0  # one play, or a lag, is the simpler model
    source = "10.3166/ejc.9.407-418"
    n_states = len(RATIOS)
    sampled = True
    parameters = (
        Parameter("narrow", "-", -1.0, 1.0, 0.1, "share that the narrow stop holds back", linear=True),
        Parameter("middle", "-", -1.0, 1.0, 0.1, "share that the middle stop holds back", linear=True),
        Parameter("wide", "-", -1.0, 1.0, 0.1, "share that the wide stop holds back", linear=True),
        Parameter("width", "-", 0.01, 0.6, 0.2, "change of the command over which the middle stop slips"),
    )
    narrow: float
    middle: float
    wide: float
    width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return stops in the middle of their range."""
        return stops_at(np.asarray(s.command, dtype=float))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move the stops by the change of the command between the two instants."""
        return stopped(x, s1.command - s0.command, self.width)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the stops along each run, without a loop over time."""
        return stops_along(s.command, self.width, starts)

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command less what the stops hold back."""
        weights = (self.narrow, self.middle, self.wide)
        held = sum(w * ratio * z for w, ratio, z in zip(weights, RATIOS, x, strict=True))
        return u - self.width * held

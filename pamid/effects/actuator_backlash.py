"""Play between the command and the actuator's motion."""

from __future__ import annotations

import numpy as np

from ..signals.paths import play
from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class ActuatorBacklash(Effect):
    r"""Lost motion in a gear or linkage of the actuator: after a reversal it does not move until the play is used up.

    .. math:: u' = \mathrm{play}_w(u)

    Parameters
    ----------
    **values : float
        ``half_width`` w (unit of the command).
    """

    name = "actuator_backlash"
    family = "hysteresis"
    equations = ("valve",)
    roles = ("command",)
    kinds = ("motor",)
    source = "10.1016/S0005-1098(02)00047-X"
    n_states = 1
    sampled = True
    parameters = (Parameter("half_width", "-", 0.0, 0.5, 0.03, "half the play"),)
    half_width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the middle of the play."""
        return np.array(s.command, dtype=float)[None]

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Drag the actuator along where the play is used up."""
        return np.clip(x, s1.command - self.half_width, s1.command + self.half_width)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the actuator's motion along each run, without a loop over time."""
        return play(np.asarray(s.command, dtype=float), self.half_width, starts)[None]

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return what follows the command with play."""
        return np.asarray(x[0])

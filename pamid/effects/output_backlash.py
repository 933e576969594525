"""Play between the driven part and the reading."""

from __future__ import annotations

import numpy as np

from ..signals.paths import play
from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class OutputBacklash(Effect):
    r"""Lost motion behind a drive: after a reversal the reading does not move until the play is used up.

    .. math:: y' = \mathrm{play}_w(y)

    This is a gear's play, or a position controller of low gain k against dry friction :math:`F_c`, for which w is
    :math:`F_c / k`: the joint sticks until the control error overcomes the friction. Each run begins at its first
    reading.

    Parameters
    ----------
    **values : float
        ``half_width`` w (unit of the reading).

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.effects import make_effect
    >>> from pamid.effects.base import Signals
    >>> lost = make_effect("output_backlash", half_width=0.5)
    >>> lost.trace(Signals(force=np.array([0.0, 2.0, 1.5, 0.0])), None, 0.01, np.array([0]))[0]
    array([0. , 1.5, 1.5, 0.5])
    """

    name = "output_backlash"
    family = "hysteresis"
    equations = ("joint",)
    roles = ("force",)
    channel = "F"
    kinds = ("joint", "motor")
    prior = -4.0  # friction at the joint is equivalent for a drive that pushes with a force
    source = "10.1016/S0005-1098(02)00047-X"
    n_states = 1
    sampled = True
    parameters = (Parameter("half_width", "N", 0.0, 1e3, 1.0, "half the play"),)
    half_width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the play where what is driven stands."""
        return np.array(s.force, dtype=float)[None]

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Drag the reading along where the play is used up."""
        return np.clip(x, s1.force - self.half_width, s1.force + self.half_width)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return what is read along each run, without a loop over time."""
        return play(np.asarray(s.force, dtype=float), self.half_width, starts)[None]

    def measure(self, value: Array, x: Array) -> Array:
        """Return what is dragged along."""
        return np.asarray(x[0])

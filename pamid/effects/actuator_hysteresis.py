"""Rate-independent hysteresis between the command and the actuator's motion."""

from __future__ import annotations

from ..signals.state import Array
from ._laws import Stops
from ._stop import RATIOS
from .base import Signals
from .plant import Plant
from .values import Parameter


class ActuatorHysteresis(Stops):
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
    equations = ("valve",)
    of = "command"
    roles = ("command",)
    kinds = ("motor",)
    prior = -2.0  # one play, or a lag, is the simpler model
    source = "10.3166/ejc.9.407-418"
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

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command less the output of the stops."""
        weights = (self.narrow, self.middle, self.wide)
        held = sum(w * ratio * z for w, ratio, z in zip(weights, RATIOS, x, strict=True))
        return u - self.width * held

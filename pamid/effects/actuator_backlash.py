"""LostMotion between the command and the actuator's motion."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._laws import LostMotion
from .base import Signals
from .plant import Plant
from .values import Parameter


class ActuatorBacklash(LostMotion):
    r"""Lost motion in a gear or linkage of the actuator.

    .. math:: u' = \mathrm{play}_w(u)

    Parameters
    ----------
    **values : float
        ``half_width`` w (unit of the command).
    """

    name = "actuator_backlash"
    equations = ("valve",)
    roles = ("command",)
    of = "command"
    kinds = ("motor",)
    parameters = (Parameter("half_width", "-", 0.0, 0.5, 0.03, "half the play"),)

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the output that follows the command with play."""
        return np.asarray(x[0])

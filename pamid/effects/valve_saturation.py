"""A valve that does not open fully."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class ValveSaturation(Effect):
    r"""A stop before full opening.

    .. math:: u' = \max(-u_s, \min(u_s, u))
    """

    name = "valve_saturation"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    parameters = (Parameter("limit", "-", 0.02, 1.0, 0.5, "largest opening", idle=True),)
    limit: float

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command within ±u_s."""
        return np.clip(u, -self.limit, self.limit)

"""A sensor, or an actuator, at the end of its range."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect
from .values import Parameter


class OutputSaturation(Effect):
    r"""The delivered force, or a reading, saturates at a limit.

    .. math:: y' = \max(-y_s, \min(y_s, y))
    """

    name = "output_saturation"
    family = "sensor"
    equations = ("force", "joint")
    roles = ("force",)
    channel = "F"
    kinds = ("muscle", "actuator", "joint", "motor")
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("limit", "N", 1e-2, 1e5, 280.0, "largest value", idle=True),)
    limit: float

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value within ±y_s."""
        return np.clip(value, -self.limit, self.limit)

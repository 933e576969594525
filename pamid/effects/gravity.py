"""A load under gravity."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class Gravity(Effect):
    r"""A mass on a lever.

    .. math:: \Delta\tau = -m g l\,\sin(q + \varphi)

    Parameters
    ----------
    **values : float
        ``moment`` m g l (N m), ``angle`` φ of the lever from hanging at q = 0 (rad).
    """

    name = "gravity"
    family = "load"
    equations = ("joint",)
    site = "joint"
    roles = ("position",)
    source = "10.1109/37.833638"
    parameters = (
        Parameter("moment", "N m", 0.0, 1e3, 1.0, "weight times lever", linear=True),
        Parameter("angle", "rad", -3.1416, 3.1416, 0.0, "lever from hanging at joint angle 0"),
    )
    moment: float
    angle: float

    def torque(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the torque of the weight, N m."""
        return -self.moment * np.sin(s.position + self.angle)

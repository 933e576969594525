"""An encoder whose readings come late."""

from __future__ import annotations

from ._sensor import Delay, OfAngle
from .values import Parameter


class AngleDelay(OfAngle, Delay):
    r"""An encoder whose readings come late.

    .. math:: q'(t) = q(t - d)
    """

    name = "angle_delay"
    parameters = (Parameter("delay", "s", 0.0, 0.2, 0.005, "age of the reading"),)

"""An encoder whose readings come late."""

from __future__ import annotations

from ._sensor import Delay
from .values import Parameter


class AngleDelay(Delay):
    r"""An encoder whose readings come late.

    .. math:: q'(t) = q(t - d)

    Parameters
    ----------
    **values : float
        ``delay`` age of the reading (s).
    """

    name = "angle_delay"
    family = "sensor"
    equations = ("force", "flow", "joint")
    channel = "q"
    site = "joint"
    roles = ("position",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("delay", "s", 0.0, 0.2, 0.005, "age of the reading"),)
    delay: float

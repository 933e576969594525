"""An encoder with a wrong scale."""

from __future__ import annotations

from ._sensor import Gain
from .values import Parameter


class AngleGain(Gain):
    r"""An encoder with a wrong scale.

    .. math:: q' = (1 + \delta)\,q

    Parameters
    ----------
    **values : float
        ``deviation`` relative deviation of the reading (dimensionless).
    """

    name = "angle_gain"
    family = "sensor"
    equations = ("force", "flow", "joint")
    channel = "q"
    site = "joint"
    roles = ("position",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("deviation", "-", -0.5, 0.5, 0.02, "relative deviation of the reading", linear=True),)
    deviation: float

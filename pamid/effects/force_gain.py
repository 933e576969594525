"""A load cell with a wrong sensitivity."""

from __future__ import annotations

from ._sensor import Gain
from .values import Parameter


class ForceGain(Gain):
    r"""A load cell with a wrong sensitivity.

    .. math:: F' = (1 + \delta)\,F

    Parameters
    ----------
    **values : float
        ``deviation`` relative deviation of the reading (dimensionless).
    """

    name = "force_gain"
    family = "sensor"
    equations = ("force", "joint")
    channel = "F"
    site = "muscle"
    roles = ("force",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("deviation", "-", -0.5, 0.5, 0.02, "relative deviation of the reading", linear=True),)
    deviation: float

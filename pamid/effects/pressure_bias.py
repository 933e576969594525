"""A pressure sensor with an offset."""

from __future__ import annotations

from ._sensor import Bias
from .values import Parameter


class PressureBias(Bias):
    r"""A pressure sensor with an offset.

    .. math:: P' = P + P_0

    Parameters
    ----------
    **values : float
        ``offset`` offset of the reading (Pa).
    """

    name = "pressure_bias"
    family = "sensor"
    equations = ("force", "flow", "valve")
    channel = "P"
    site = "muscle"
    roles = ("pressure",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("offset", "Pa", -1.2e5, 1.2e5, 2e3, "offset of the reading", linear=True),)
    offset: float

"""A pressure sensor with an offset."""

from __future__ import annotations

from ._sensor import Bias, OfPressure
from .values import Parameter


class PressureBias(OfPressure, Bias):
    r"""A pressure sensor with an offset.

    .. math:: P' = P + P_0
    """

    name = "pressure_bias"
    parameters = (Parameter("offset", "Pa", -1.2e5, 1.2e5, 2e3, "offset of the reading", linear=True),)

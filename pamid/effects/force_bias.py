"""A load cell with an offset."""

from __future__ import annotations

from ._sensor import Bias
from .values import Parameter


class ForceBias(Bias):
    r"""A load cell with an offset.

    .. math:: F' = F + F_0

    Parameters
    ----------
    **values : float
        ``offset`` offset of the reading (N).
    """

    name = "force_bias"
    family = "sensor"
    equations = ("force", "joint")
    channel = "F"
    site = "muscle"
    roles = ("force",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("offset", "N", -500.0, 500.0, 3.0, "offset of the reading", linear=True),)
    offset: float

"""A load cell with an offset."""

from __future__ import annotations

from ._sensor import Bias, OfForce
from .values import Parameter


class ForceBias(OfForce, Bias):
    r"""A load cell with an offset.

    .. math:: F' = F + F_0
    """

    name = "force_bias"
    parameters = (Parameter("offset", "N", -500.0, 500.0, 3.0, "offset of the reading", linear=True),)

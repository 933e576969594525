"""A flow meter with an offset."""

from __future__ import annotations

from ._sensor import Bias, OfFlow
from .values import Parameter


class FlowBias(OfFlow, Bias):
    r"""A flow meter with an offset.

    .. math:: \dot m' = \dot m + \dot m_0
    """

    name = "flow_bias"
    parameters = (Parameter("offset", "kg/s", -1e-3, 1e-3, 1e-5, "offset of the reading", linear=True),)

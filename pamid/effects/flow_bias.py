"""A flow meter with an offset."""

from __future__ import annotations

from ._sensor import Bias
from .values import Parameter


class FlowBias(Bias):
    r"""A flow meter with an offset.

    .. math:: \dot m' = \dot m + \dot m_0

    Parameters
    ----------
    **values : float
        ``offset`` offset of the reading (kg/s).
    """

    name = "flow_bias"
    family = "sensor"
    equations = ("flow", "valve")
    channel = "mdot"
    site = "muscle"
    roles = ("flow",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("offset", "kg/s", -1e-3, 1e-3, 1e-5, "offset of the reading", linear=True),)
    offset: float

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

    References
    ----------
    R. Isermann, "Fault-Diagnosis Systems", Springer, 2006. https://doi.org/10.1007/3-540-30368-5

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("angle_gain", deviation=0.02)
    angle_gain(deviation=0.02)
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

"""A load cell behind a slow amplifier."""

from __future__ import annotations

from ._sensor import Lag
from .base import Parameter


class ForceLag(Lag):
    r"""A load cell behind a slow amplifier.

    .. math:: \tau\,\dot F' = F - F'

    Parameters
    ----------
    **values : float
        ``time_constant`` time constant of the amplifier (s).

    References
    ----------
    R. Isermann, "Fault-Diagnosis Systems", Springer, 2006. https://doi.org/10.1007/3-540-30368-5

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("force_lag", time_constant=0.01)
    force_lag(time_constant=0.01 s)
    """

    name = "force_lag"
    family = "sensor"
    equations = ("force", "joint")
    channel = "F"
    site = "muscle"
    roles = ("force",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of the amplifier"),)
    time_constant: float

"""A pressure sensor that lags, for instance behind a tube."""

from __future__ import annotations

from ._sensor import Lag
from .base import Parameter


class PressureLag(Lag):
    r"""A pressure sensor that lags, for instance behind a tube.

    .. math:: \tau\,\dot P' = P - P'

    Parameters
    ----------
    **values : float
        ``time_constant`` time constant of sensor and tube (s).

    References
    ----------
    R. Isermann, "Fault-Diagnosis Systems", Springer, 2006. https://doi.org/10.1007/3-540-30368-5

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("pressure_lag", time_constant=0.01)
    pressure_lag(time_constant=0.01 s)
    """

    name = "pressure_lag"
    family = "sensor"
    equations = ("force", "flow", "valve")
    channel = "P"
    site = "muscle"
    roles = ("pressure",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of sensor and tube"),)
    time_constant: float

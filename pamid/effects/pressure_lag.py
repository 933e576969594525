"""A pressure sensor that lags, for instance behind a tube."""

from __future__ import annotations

from ._sensor import SECOND, Lag, OfPressure
from .values import Parameter


class PressureLag(OfPressure, Lag):
    r"""A pressure sensor that lags.

    .. math:: \tau_1\,\frac{\mathrm{d}x}{\mathrm{d}t} = P - x, \qquad
        \tau_2\,\frac{\mathrm{d}P'}{\mathrm{d}t} = x - P', \qquad
        \tau_1 + \tau_2 = \tau, \qquad \tau_2 = s\,\tau_1

    Parameters
    ----------
    **values : float
        ``time_constant`` τ, time constant of sensor and tube (s); ``second`` s, its second lag as a share of the first
        (dimensionless): 0 for a lag of first order.
    """

    name = "pressure_lag"
    parameters = (
        Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of sensor and tube"),
        SECOND,
    )

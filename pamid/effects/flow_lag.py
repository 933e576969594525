"""A flow meter that lags."""

from __future__ import annotations

from ._sensor import SECOND, Lag, OfFlow
from .values import Parameter


class FlowLag(OfFlow, Lag):
    r"""A flow meter that lags.

    .. math:: \tau_1\,\frac{\mathrm{d}x}{\mathrm{d}t} = \dot m - x, \qquad
        \tau_2\,\frac{\mathrm{d}\dot m'}{\mathrm{d}t} = x - \dot m', \qquad
        \tau_1 + \tau_2 = \tau, \qquad \tau_2 = s\,\tau_1

    Parameters
    ----------
    **values : float
        ``time_constant`` τ, time constant of the meter (s); ``second`` s, its second lag as a share of the first
        (dimensionless): 0 for a lag of first order.
    """

    name = "flow_lag"
    parameters = (
        Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of the meter"),
        SECOND,
    )

"""A flow meter that lags."""

from __future__ import annotations

from ._sensor import Lag
from .values import Parameter


class FlowLag(Lag):
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
    family = "sensor"
    equations = ("flow", "valve")
    channel = "mdot"
    site = "muscle"
    roles = ("flow",)
    source = "10.1007/3-540-30368-5"
    parameters = (
        Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of the meter"),
        Parameter("second", "-", 0.0, 1.0, 0.0, "second lag as a share of the first"),
    )
    time_constant: float
    second: float

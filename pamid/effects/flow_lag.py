"""A flow meter that lags."""

from __future__ import annotations

from ._sensor import Lag
from .base import Parameter


class FlowLag(Lag):
    r"""A flow meter that lags.

    .. math:: \tau\,\frac{\mathrm{d}\dot m'}{\mathrm{d}t} = \dot m - \dot m'

    Parameters
    ----------
    **values : float
        ``time_constant`` time constant of the meter (s).

    References
    ----------
    R. Isermann, "Fault-Diagnosis Systems", Springer, 2006. https://doi.org/10.1007/3-540-30368-5

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("flow_lag", time_constant=0.01)
    flow_lag(time_constant=0.01 s)
    """

    name = "flow_lag"
    family = "sensor"
    equations = ("flow", "valve")
    channel = "mdot"
    site = "muscle"
    roles = ("flow",)
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of the meter"),)
    time_constant: float

"""A load cell behind a slow amplifier."""

from __future__ import annotations

from ._sensor import SECOND, Lag, OfForce
from .values import Parameter


class ForceLag(OfForce, Lag):
    r"""A load cell behind a slow amplifier.

    .. math:: \tau_1\,\frac{\mathrm{d}x}{\mathrm{d}t} = F - x, \qquad
        \tau_2\,\frac{\mathrm{d}F'}{\mathrm{d}t} = x - F', \qquad
        \tau_1 + \tau_2 = \tau, \qquad \tau_2 = s\,\tau_1

    Parameters
    ----------
    **values : float
        ``time_constant`` τ, time constant of the amplifier (s); ``second`` s, its second lag as a share of the first
        (dimensionless): 0 for a lag of first order.
    """

    name = "force_lag"
    parameters = (
        Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of the sensor"),
        SECOND,
    )

"""A pressure sensor with a wrong sensitivity, its zero at ambient pressure."""

from __future__ import annotations

from ..constants import ATMOSPHERIC_PRESSURE
from ._sensor import Gain, OfPressure
from .values import Parameter


class PressureGain(OfPressure, Gain):
    r"""A pressure sensor with a wrong sensitivity.

    .. math:: P' = P + \delta\,(P - P_0)

    Parameters
    ----------
    **values : float
        ``deviation`` δ, relative deviation (dimensionless), ``zero`` P₀, where the sensor reads correctly (Pa,
        absolute).
    """

    name = "pressure_gain"
    parameters = (
        Parameter("deviation", "-", -0.5, 0.5, 0.02, "deviation of the pressure from the zero", linear=True),
        Parameter("zero", "Pa", 0.0, 1.2e5, ATMOSPHERIC_PRESSURE, "pressure at which the reading is right"),
    )

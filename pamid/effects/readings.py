"""Readings that are shifted, scaled, rounded or without a sign."""

from __future__ import annotations

import numpy as np

from ..constants import ATMOSPHERIC_PRESSURE
from ..signals.state import Array
from ._places import Invertible, OfAngle, OfFlow, OfForce, OfPressure
from .values import parameter


class _Offset(Invertible):
    """A constant added to every reading: parameter ``offset``."""

    offset: float

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value plus the offset."""
        return value + self.offset

    def restore_next(self, before: Array, reading: Array, dt: Array) -> Array:
        """Return the reading less the offset."""
        return reading - self.offset


class _Sensitivity(Invertible):
    """Every reading too large or too small by a factor: parameter ``deviation``."""

    deviation = parameter("-", -0.5, 0.5, 0.02, "relative deviation of the reading", linear=True)
    zero: float = 0.0

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value times 1 + deviation, about the zero of the sensor."""
        return value + self.deviation * (value - self.zero)

    def restore_next(self, before: Array, reading: Array, dt: Array) -> Array:
        """Return the value behind the reading."""
        return (reading + self.deviation * self.zero) / (1.0 + self.deviation)


class PressureBias(_Offset, OfPressure):
    r"""A pressure sensor with an offset.

    .. math:: P' = P + P_0
    """

    name = "pressure_bias"
    offset = parameter("Pa", -1.2e5, 1.2e5, 2e3, "offset of the reading", linear=True)


class ForceBias(_Offset, OfForce):
    r"""A load cell with an offset.

    .. math:: F' = F + F_0
    """

    name = "force_bias"
    offset = parameter("N", -500.0, 500.0, 3.0, "offset of the reading", linear=True)


class FlowBias(_Offset, OfFlow):
    r"""A flow meter with an offset.

    .. math:: \dot m' = \dot m + \dot m_0
    """

    name = "flow_bias"
    offset = parameter("kg/s", -1e-3, 1e-3, 1e-5, "offset of the reading", linear=True)


class PressureGain(_Sensitivity, OfPressure):
    r"""A pressure sensor with a wrong sensitivity.

    .. math:: P' = P + \delta\,(P - P_0)
    """

    name = "pressure_gain"
    deviation = parameter("-", -0.5, 0.5, 0.02, "deviation of the pressure from the zero", linear=True, symbol="δ")
    zero = parameter("Pa", 0.0, 1.2e5, ATMOSPHERIC_PRESSURE, "pressure at which the reading is right", symbol="P₀")


class ForceGain(_Sensitivity, OfForce):
    r"""A load cell with a wrong sensitivity.

    .. math:: F' = (1 + \delta)\,F
    """

    name = "force_gain"


class AngleGain(_Sensitivity, OfAngle):
    r"""An encoder with a wrong scale.

    .. math:: q' = (1 + \delta)\,q
    """

    name = "angle_gain"


class Quantisation(OfForce):
    r"""A reading in fixed steps.

    .. math:: y' = d\,\mathrm{round}(y / d)

    References
    ----------
    B. Widrow, I. Kollár, "Quantization Noise", Cambridge University Press, 2008.
    https://doi.org/10.1017/CBO9780511754661
    """

    name = "quantisation"
    kinds = ("actuator", "joint", "motor", "muscle")
    prior = -6.0  # it leaves noise rather than a gap, unless its steps are large
    source = "10.1017/CBO9780511754661"
    resolution = parameter("N", 1e-4, 1e3, 1.0, "step of the reading")

    def measure(self, value: Array, x: Array) -> Array:
        """Return the nearest step."""
        return self.resolution * np.round(np.asarray(value) / self.resolution)


class Rectification(OfForce):
    r"""A reading without its sign, as from counted pulses, a rectified voltage or a plain tachometer.

    .. math:: y' = y + s\,(|y| - y)

    With s = 1 the magnitude is read, with s = 1/2 negative values read zero.

    References
    ----------
    T. Wigren, M. Schoukens, "Coupled Electric Drives Data Set and Reference Models", technical report 2017-024,
    Uppsala University, 2017: the speed of a belt, counted in pulses. J. Schoukens, L. Ljung, "Nonlinear System
    Identification: A User-Oriented Road Map", IEEE Control Systems Magazine 39(6), 2019.
    https://doi.org/10.1109/MCS.2019.2938121
    """

    name = "rectification"
    equations = ("joint",)
    kinds = ("joint", "motor")
    source = "10.1109/MCS.2019.2938121"
    share = parameter("-", 0.0, 1.0, 1.0, "share of the sign that is lost", linear=True)

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value, made positive by the share."""
        y = np.asarray(value, dtype=float)
        return y + self.share * (np.abs(y) - y)

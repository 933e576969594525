"""A sensor that reads a magnitude: the sign is lost, wholly or in part."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect
from .values import Parameter


class Rectification(Effect):
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
    family = "sensor"
    equations = ("joint",)
    roles = ("force",)
    channel = "F"
    kinds = ("joint", "motor")
    source = "10.1109/MCS.2019.2938121"
    parameters = (Parameter("share", "-", 0.0, 1.0, 1.0, "share of the sign that is lost", linear=True),)
    share: float

    def measure(self, value: Array, x: Array) -> Array:
        """Return the value, made positive by the share."""
        y = np.asarray(value, dtype=float)
        return y + self.share * (np.abs(y) - y)

"""Loads on a joint that depend on where it is."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class Gravity(Effect):
    r"""A mass on a lever.

    .. math:: \Delta\tau = -m g l\,\sin(q + \varphi)
    """

    name = "gravity"
    family = "load"
    site = "joint"
    roles = ("position",)
    source = "10.1109/37.833638"
    moment = parameter("N m", 0.0, 1e3, 1.0, "weight times lever", linear=True, symbol="m g l")
    angle = parameter("rad", -3.1416, 3.1416, 0.0, "lever from hanging at joint angle 0", symbol="φ")

    def torque(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the torque of the weight, N m."""
        return -self.moment * np.sin(s.position + self.angle)


class PeriodicForce(Effect):
    r"""Cogging of a motor's magnets, ripple of a screw or a gear, an eccentric wheel.

    .. math:: \Delta\tau = a\,\sin(n q) + b\,\cos(n q)

    References
    ----------
    S. M. Hwang, J. B. Eom, G. B. Hwang, W. B. Jeong, Y. H. Jung, "Cogging torque and acoustic noise reduction in
    permanent magnet motors by teeth pairing", IEEE Transactions on Magnetics 36(5), 2000.
    https://doi.org/10.1109/20.908714
    """

    name = "periodic_force"
    family = "load"
    site = "joint"
    roles = ("position",)
    kinds = ("actuator", "joint", "motor")
    source = "10.1109/20.908714"
    sine = parameter("N m", -1e3, 1e3, 1.0, "amplitude of the sine", linear=True, symbol="a")
    cosine = parameter("N m", -1e3, 1e3, 0.0, "amplitude of the cosine", linear=True, symbol="b")
    rate = parameter("1/rad", 1e-2, 1e6, 10.0, "periods in 2π of the position", periods=True, symbol="n")

    def torque(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return a sin(n q) + b cos(n q), N m."""
        return self.sine * np.sin(self.rate * s.position) + self.cosine * np.cos(self.rate * s.position)

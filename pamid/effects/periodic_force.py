"""Force or torque that repeats with each turn, tooth or magnet."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class PeriodicForce(Effect):
    r"""Cogging of a motor's magnets, ripple of a screw or a gear, an eccentric wheel.

    .. math:: \Delta\tau = a\,\sin(n q) + b\,\cos(n q)

    Parameters
    ----------
    **values : float
        ``sine`` a and ``cosine`` b (N m), ``rate`` n, periods in 2π of the position (1/rad; any number).

    References
    ----------
    S. M. Hwang, J. B. Eom, G. B. Hwang, W. B. Jeong, Y. H. Jung, "Cogging torque and acoustic noise reduction in
    permanent magnet motors by teeth pairing", IEEE Transactions on Magnetics 36(5), 2000.
    https://doi.org/10.1109/20.908714
    """

    name = "periodic_force"
    family = "load"
    equations = ("joint",)
    site = "joint"
    roles = ("position",)
    kinds = ("actuator", "joint", "motor")
    source = "10.1109/20.908714"
    parameters = (
        Parameter("sine", "N m", -1e3, 1e3, 1.0, "amplitude of the sine", linear=True),
        Parameter("cosine", "N m", -1e3, 1e3, 0.0, "amplitude of the cosine", linear=True),
        Parameter("rate", "1/rad", 1e-2, 1e6, 10.0, "periods in 2π of the position", periods=True),
    )
    sine: float
    cosine: float
    rate: float

    def torque(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return a sin(n q) + b cos(n q), N m."""
        return self.sine * np.sin(self.rate * s.position) + self.cosine * np.cos(self.rate * s.position)

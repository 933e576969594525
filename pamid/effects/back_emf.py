"""Voltage that a turning motor induces."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class BackEmf(Effect):
    r"""Back-EMF: the voltage that a turning motor induces against its drive.

    .. math:: \Delta U = -k_e\,\dot q

    On one log it is the same as a viscous friction; the data sheet of the motor distinguishes them.

    Parameters
    ----------
    **values : float
        ``constant`` k_e (V s/rad).

    References
    ----------
    R. Isermann, "Mechatronic Systems: Fundamentals", Springer, 2005. https://doi.org/10.1007/1-84628-259-4
    """

    name = "back_emf"
    family = "drive"
    equations = ("joint",)
    roles = ("velocity",)
    site = "joint"
    kinds = ("motor",)
    source = "10.1007/1-84628-259-4"
    parameters = (Parameter("constant", "N m s/rad", 0.0, 1e3, 0.05, "of the motor and its gear", linear=True),)
    constant: float

    def torque(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k_e q̇, in the unit of the joint's drive."""
        return -self.constant * s.velocity

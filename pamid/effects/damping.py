"""Losses that grow with the speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class ViscousFriction(Effect):
    r"""Friction in proportion to the rate of contraction.

    .. math:: \Delta F = -c\,\dot x

    References
    ----------
    D. B. Reynolds et al., "Modeling the dynamic characteristics of pneumatic muscle", Annals of Biomedical
    Engineering 31, 2003. https://doi.org/10.1114/1.1554921
    """

    name = "viscous_friction"
    family = "friction"
    roles = ("velocity",)
    source = "10.1114/1.1554921"
    coefficient = parameter("N s", 0.0, 1e5, 60.0, "force per speed", linear=True, position=-1)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −c ẋ, N."""
        return -self.coefficient * s.velocity


class DirectionalDamping(Effect):
    r"""Friction proportional to speed, with different slopes forwards and backwards.

    .. math:: \Delta F = -c_+\,\max(\dot x, 0) - c_-\,\min(\dot x, 0)
    """

    name = "directional_damping"
    family = "friction"
    roles = ("velocity",)
    kinds = ("actuator", "joint", "motor")
    prior = -4.0  # friction alike in both directions is the simpler one
    source = "10.1016/0005-1098(94)90209-7"
    forward = parameter(
        "N s", 0.0, 1e5, 60.0, "force per speed while the position grows", linear=True, position=-1, symbol="c₊"
    )
    backward = parameter(
        "N s", 0.0, 1e5, 40.0, "force per speed while it falls", linear=True, unlike="forward", position=-1, symbol="c₋"
    )

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −c ẋ with the slope of the direction, N."""
        return -self.forward * np.maximum(s.velocity, 0.0) - self.backward * np.minimum(s.velocity, 0.0)


class QuadraticDrag(Effect):
    r"""Drag of a body or a fluid at high speed.

    .. math:: \Delta F = -c\,|\dot x|\,\dot x

    References
    ----------
    G. K. Batchelor, "An Introduction to Fluid Dynamics", Cambridge University Press, 2000.
    https://doi.org/10.1017/CBO9780511800955
    """

    name = "quadratic_drag"
    family = "friction"
    roles = ("velocity",)
    prior = -6.0  # one of the common effects is nearly always equivalent
    source = "10.1017/CBO9780511800955"
    coefficient = parameter("N s^2", 0.0, 1e6, 100.0, "force per squared rate", linear=True, position=-2)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −c |ẋ| ẋ, N."""
        return -self.coefficient * np.abs(s.velocity) * s.velocity


class JointDamping(Effect):
    r"""Damping of the joint that differs from the assumed one: b_q → b_q + Δb."""

    name = "joint_damping"
    family = "load"
    equations = ("joint",)
    site = "joint"
    source = "10.1109/37.833638"
    difference = parameter("N m s/rad", -100.0, 100.0, 0.1, "damping above the nominal one", linear=True)

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed damping, which is never negative."""
        return {"viscous_damping": max(0.0, values["viscous_damping"] + self.difference)}


class BackEmf(Effect):
    r"""Back-EMF: the voltage that a turning motor induces against its drive.

    .. math:: \Delta U = -k_e\,\dot q

    On one log it is the same as a viscous friction; the motor's data sheet, with k_e in V s/rad, distinguishes them.

    References
    ----------
    R. Isermann, "Mechatronic Systems: Fundamentals", Springer, 2005. https://doi.org/10.1007/1-84628-259-4
    """

    name = "back_emf"
    family = "drive"
    roles = ("velocity",)
    site = "joint"
    kinds = ("motor",)
    source = "10.1007/1-84628-259-4"
    constant = parameter("N m s/rad", 0.0, 1e3, 0.05, "of the motor and its gear", linear=True, symbol="k_e")

    def torque(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k_e q̇, in the unit of the joint's drive."""
        return -self.constant * s.velocity

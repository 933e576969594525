"""Damping of the joint that differs from the assumed one."""

from __future__ import annotations

from collections.abc import Mapping

from .base import Effect
from .values import Parameter


class JointDamping(Effect):
    r"""Damping of the joint that differs from the assumed one: b_q → b_q + Δb."""

    name = "joint_damping"
    family = "load"
    equations = ("joint",)
    site = "joint"
    source = "10.1109/37.833638"
    parameters = (
        Parameter("difference", "N m s/rad", -100.0, 100.0, 0.1, "damping above the nominal one", linear=True),
    )
    difference: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed damping, which is never negative."""
        return {"viscous_damping": max(0.0, values["viscous_damping"] + self.difference)}

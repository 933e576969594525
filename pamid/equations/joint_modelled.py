"""The joint with modelled tensions: two muscles that turn an inertia, where no tension is measured."""

from typing import ClassVar

import numpy as np

from .base import Equation, Residual, spread
from .force import tension, tension_slopes
from .joint import torque_balance, torque_weights
from .run import SIGNS, Run


class JointModelledEquation(Equation):
    r"""Torque of the modelled tensions minus that of the motion: force and joint with the tensions eliminated.

    .. math:: r \left(F_1(q, P_1) - F_2(q, P_2)\right) - b_q \dot q - J \ddot q
    """

    name: ClassVar[str] = "joint_modelled"
    unit: ClassVar[str] = "N m"
    channels: ClassVar[tuple[str, ...]] = ("q", "P")
    order: ClassVar[int] = 3
    rank: ClassVar[int] = 5
    sides: ClassVar[tuple[str, ...]] = ("joint",)
    combines: ClassVar[tuple[str, ...]] = ("force", "joint")
    without: ClassVar[str] = "F"

    def residual(self, run: Run) -> Residual:
        """Return the residual torque, N m."""
        windows, radius = run.windows(self), run.model.params.joint.pulley_radius
        torque = radius * ((tension(run) + run.added_force_of_speed()) @ SIGNS)
        value = torque_balance(run, windows, torque)
        time, modelled = windows.time(run.time[1:-1]), windows.mean(torque[1:-1])[:, None]
        if not run.model.noise:
            return Residual(time, value, modelled, np.zeros_like(value))
        motion, hat = torque_weights(run)
        per_pressure, per_angle = tension_slopes(run)
        stiffness = radius * float(np.mean(per_angle @ SIGNS))  # small beside what the acceleration adds of the noise
        pressure = run.covariances(windows, "P", hat * radius)
        slopes = windows.centre(per_pressure[1:-1])
        noise, shared = spread(
            (1.0, run.covariances(windows, "q", motion + stiffness * hat)),
            *((slopes[:, k, None], pressure[..., k, None]) for k in range(2)),
            n_windows=len(time),
        )
        return Residual(time, value, modelled, noise, shared)

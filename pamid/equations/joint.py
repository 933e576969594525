"""The joint equation: two muscles that turn an inertia."""

from typing import ClassVar

import numpy as np

from .base import Equation, Residual, spread
from .run import Run
from .windows import Windows, kernel


class JointEquation(Equation):
    r"""Torque of the measured tensions minus that of the motion, :math:`r (F_1 - F_2) - b_q \dot q - J \ddot q`.

    In weak form: the acceleration is the second difference of window means of the angle.
    """

    name: ClassVar[str] = "joint"
    unit: ClassVar[str] = "N m"
    channels: ClassVar[tuple[str, ...]] = ("q", "F")
    order: ClassVar[int] = 3
    rank: ClassVar[int] = 3
    sides: ClassVar[tuple[str, ...]] = ("joint",)

    def residual(self, run: Run) -> Residual:
        """Return the residual torque, N m."""
        windows = run.windows(self)
        torque = run.model.params.joint.pulley_radius * (run.F[:, 0] - run.F[:, 1])
        value = torque_balance(run, windows, torque)
        time, measured = windows.time(run.time[1:-1]), windows.mean(torque[1:-1])[:, None]
        if not run.model.noise:
            return Residual(time, value, measured, np.zeros_like(value))
        motion, hat = torque_weights(run)
        tension = run.covariances(windows, "F", hat * run.model.params.joint.pulley_radius)
        noise, shared = spread(
            (1.0, run.covariances(windows, "q", motion)),
            *((1.0, side[..., None]) for side in np.moveaxis(tension, -1, 0)),
            n_windows=len(time),
        )
        return Residual(time, value, measured, noise, shared)


def torque_balance(run: Run, windows: Windows, torque: np.ndarray) -> np.ndarray:
    """Return a torque and those of effects, less that of the motion, over windows of order 3, N m."""
    joint, q, dt = run.model.params.joint, run.q, run.dt
    speed = (q[2:] - q[:-2]) / (2 * dt)
    acceleration = (q[2:] - 2 * q[1:-1] + q[:-2]) / dt**2
    # The second difference is the acceleration under a hat two samples wide; so is a torque that goes straight from
    # sample to sample, with a kink where a held command changes.
    pull = torque + np.broadcast_to(run.added_torque(), q.shape)
    driven = (pull[:-2] + 4.0 * pull[1:-1] + pull[2:]) / 6.0
    return windows.mean(driven - joint.viscous_damping * speed - joint.inertia * acceleration)[:, None]


def torque_weights(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of angles in the torque of the motion (N m/rad) and of torques in their mean."""
    joint, dt, weights = run.model.params.joint, run.dt, kernel(run.n, 3)
    motion = np.convolve(weights, [1.0, 0.0, -1.0]) * joint.viscous_damping / (2 * dt)
    motion = motion + np.convolve(weights, [1.0, -2.0, 1.0]) * joint.inertia / dt**2
    return motion, np.convolve(weights, [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0])

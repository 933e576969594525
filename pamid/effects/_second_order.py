"""A second-order lag, exact for an input that is held or linear between two instants."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..signals.recursion import recursive
from ..signals.state import Array


@lru_cache(maxsize=64)
def transition(
    frequency: float, damping: float, dt: float, ramp: bool, damper: bool = False
) -> tuple[Array, Array, Array]:
    r"""Return the transition of (y, ẏ) over an interval, :math:`\ddot y = \omega^2 (v - y) - 2 \zeta \omega\,\dot y`.

    With a `damper` beside the spring the second state is :math:`\dot y - 2 \zeta \omega\,(v - y)`.
    """
    from scipy.linalg import expm

    # The input and its rate are carried along as two more states.
    A = np.zeros((4, 4))
    A[0, 1] = 1.0
    A[1] = -(frequency**2), -2.0 * damping * frequency, frequency**2, 0.0
    if damper:
        A[0] = -2.0 * damping * frequency, 1.0, 2.0 * damping * frequency, 0.0
        A[1, 1] = 0.0
    A[2, 3] = 1.0 if ramp else 0.0
    E = expm(A * dt)
    slope = E[:2, 3] / dt if dt > 0.0 else 0.0 * E[:2, 3]
    return E[:2, :2], E[:2, 2] - slope, slope


def carried(x: Array, v0: Array, v1: Array, frequency: float, damping: float, dt: float, ramp: bool) -> Array:
    """Return the states (y, ẏ) along the first axis after an interval."""
    M, old, new = transition(frequency, damping, dt, ramp)
    shape = (2, *[1] * np.ndim(v0))
    return (M @ x.reshape(2, -1)).reshape(x.shape) + old.reshape(shape) * v0 + new.reshape(shape) * v1


def carried_along(
    v: Array, dt: float, frequency: float, damping: float, starts: Array, ramp: bool, speed: Array = None
) -> Array:
    """Return `carried` along runs, at rest at each start; with the input's `speed`, a damper is beside the spring."""
    v = np.asarray(v, dtype=float)
    M, old, new = transition(frequency, damping, dt, ramp, speed is not None)
    begin = np.zeros(len(v), dtype=int)
    begin[starts] = starts
    rest = v[np.maximum.accumulate(begin)]  # at rest the output is the input
    u, shape = v - rest, (2, *[1] * v.ndim)
    d = new.reshape(shape) * u
    d[:, 1:] += old.reshape(shape) * u[:-1]
    d[:, starts] = 0.0
    if speed is not None:
        d[1, starts] = speed[starts]
    # M is a root of its characteristic polynomial, so that each state goes on from its own past alone.
    trace, determinant = float(np.trace(M)), float(np.linalg.det(M))
    drive = d.copy()
    drive[:, 1:] += np.tensordot(M - trace * np.eye(2), d[:, :-1], 1)
    drive[:, starts] = d[:, starts]
    out = np.moveaxis(recursive(np.moveaxis(drive, 0, -1), [trace, -determinant], starts), -1, 0)
    out[0] += rest
    return out

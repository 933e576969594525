"""Relations of two channels: whether one is the derivative of the other, or follows it."""

from __future__ import annotations

import numpy as np

_PARTS = 200
"""Windows a run is cut into: a change over a window is compared with the noise of its mean."""


def rate_between(t: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> tuple[float, float]:
    """Return how far one channel is the derivative of another.

    The change of a position over a window is compared with the integral of the velocity over it; nothing is
    differentiated, so noise of single samples hardly counts.
    """
    known = np.isfinite(t) & np.isfinite(position) & np.isfinite(velocity)
    t, x, v = t[known], position[known], velocity[known]
    k = max(len(t) // _PARTS, 1)
    if len(t) < 10 or np.ptp(x) == 0.0 or np.ptp(v) == 0.0:
        return float("nan"), float("nan")
    area = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    change, integral = x[k:] - x[:-k], area[k:] - area[:-k]
    power = float(integral @ integral)
    r = _correlation(change, integral)
    return r, float(change @ integral) / power if power > 0.0 else float("nan")


def follows(command: np.ndarray, reading: np.ndarray) -> float:
    """Return the correlation of a command with a reading; NaN where one of them rests."""
    known = np.isfinite(command) & np.isfinite(reading)
    return _correlation(command[known], reading[known])


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    if len(a) < 3:
        return float("nan")
    a, b = a - a.mean(), b - b.mean()
    power = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / power if power > 0.0 else float("nan")

"""Kalman/RTS rates: a smoother of constant acceleration, with filterpy behind this one module.

The state is (value, rate, acceleration), driven by white jerk; the value is measured. filterpy runs the first stretch,
where the gain still changes; from there on the gain is constant, and filter and smoother are first-order recursions.
filterpy's ready-made kinematic filters measure sums of axes in version 2; F, H and Q are therefore built here.
Rauch, Tung and Striebel (1965), DOI 10.2514/3.3166; steady gain by the discrete Riccati equation.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

CURVED_ENDS = False
_HALF_POWER = np.sqrt(2.0) - 1.0
_LOWEST = 2e-4
_LONGEST_START = 1500
_WIDE = 1e6


class Smoother(NamedTuple):
    """A smoother at one cut-off frequency, in a state scaled by it: (y, ẏ/ω, ÿ/ω²)."""

    omega: float
    """Bandwidth ω, rad per sample."""
    F: np.ndarray
    H: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    """Transition (3, 3), measurement (1, 3), process noise (3, 3), measurement noise (1, 1)."""


@lru_cache(maxsize=64)
def model(cutoff: float) -> Smoother:
    """Build the model of constant acceleration for a cut-off frequency."""
    w = 2.0 * np.pi * max(cutoff, _LOWEST)
    F = np.array([[1.0, w, w * w / 2.0], [0.0, 1.0, w], [0.0, 0.0, 1.0]])
    H = np.array([[1.0, 0.0, 0.0]])
    q = 1.0 / _HALF_POWER
    Q = q * np.array(
        [[w**6 / 20.0, w**5 / 8.0, w**4 / 6.0], [w**5 / 8.0, w**4 / 3.0, w**3 / 2.0], [w**4 / 6.0, w**3 / 2.0, w**2]]
    )
    return Smoother(w, F, H, Q, np.eye(1))


def gain(omega: np.ndarray, cutoff: float) -> np.ndarray:
    """Response of the smoothed rate divided by that of the true derivative."""
    w = 2.0 * np.pi * max(cutoff, _LOWEST)
    return 1.0 / (1.0 + _HALF_POWER * (2.0 * np.sin(omega / 2.0) / w) ** 6)


def filterpy_filter(m: Smoother, P: np.ndarray) -> Any:
    """Set up a filterpy filter of this model."""
    from filterpy.kalman import KalmanFilter

    kf = KalmanFilter(dim_x=3, dim_z=1)
    kf.F, kf.H, kf.Q, kf.R, kf.P = (np.array(x, dtype=float) for x in (m.F, m.H, m.Q, m.R, P))
    return kf


class Steady(NamedTuple):
    """Constant gains of a model."""

    P: np.ndarray
    """Covariance of the filtered state, shape (3, 3)."""
    K: np.ndarray
    """Kalman gain, shape (3,)."""
    C: np.ndarray
    """Gain of the RTS smoother, shape (3, 3)."""


@lru_cache(maxsize=64)
def steady(cutoff: float) -> Steady:
    """Solve the Riccati equation for the gains of a long log."""
    from scipy.linalg import solve_discrete_are

    m = model(cutoff)
    predicted = solve_discrete_are(m.F.T, m.H.T, m.Q, m.R)
    K = predicted @ m.H.T / (m.H @ predicted @ m.H.T + m.R)
    filtered = predicted - K @ m.H @ predicted
    filtered = (filtered + filtered.T) / 2.0
    C = np.linalg.solve(predicted.T, (filtered @ m.F.T).T).T
    return Steady(filtered, K[:, 0], C)


def smooth(y: np.ndarray, cutoff: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smooth and differentiate at a unit step."""
    m, gains = model(cutoff), steady(cutoff)
    centre, spread = y.mean(axis=0), y.std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    y = (y - centre) / spread
    start = min(len(y), _LONGEST_START, int(np.ceil(12.0 / m.omega)) + 20)
    states = np.empty((len(y), 3, y.shape[1]))
    for channel in range(y.shape[1]):
        states[:, :, channel] = _smooth_one(y[:, channel], m, gains, start)
    states *= spread
    return states[:, 0] + centre, states[:, 1] * m.omega, states[:, 2] * m.omega**2


def _smooth_one(y: np.ndarray, m: Smoother, gains: Steady, start: int) -> np.ndarray:
    """Filter and smooth with varying gains over the first stretch, with constant ones behind it."""
    x0, P0 = _initial(y, m)
    kf = filterpy_filter(m, P0)
    kf.x = x0[:, None]
    # filterpy predicts before its first update; updating first keeps the prior at the first sample.
    means, covariances, _, _ = kf.batch_filter(y[:start, None, None], update_first=True)
    later = np.empty((0, 3))
    if start < len(y):
        A = m.F - np.outer(gains.K, m.H @ m.F)
        later = _recursion(A, gains.K[:, None] * y[start:], means[-1, :, 0])
        drive = (np.eye(3) - gains.C @ m.F) @ later[:-1].T
        later[:-1] = _recursion(gains.C, drive[:, ::-1], later[-1])[::-1]
        means = np.concatenate([means, later[:1, :, None]])
        covariances = np.concatenate([covariances, gains.P[None]])
    return np.concatenate([kf.rts_smoother(means, covariances)[0][:start, :, 0], later])


def _initial(y: np.ndarray, m: Smoother) -> tuple[np.ndarray, np.ndarray]:
    """A parabola through the first samples, with a prior so wide that the data decide; it only keeps precision."""
    k = np.arange(min(len(y), _LONGEST_START, int(np.ceil(2.0 / m.omega)) + 4)) * m.omega
    value, rate, half = np.linalg.lstsq(np.vander(k, 3, increasing=True), y[: len(k)], rcond=None)[0]
    return np.array([value, rate, 2.0 * half]), np.eye(3) * _WIDE


def _recursion(A: np.ndarray, drive: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Solve x[k] = A x[k-1] + drive[k] from x[-1] = first, by the eigenvectors of A."""
    from scipy.signal import lfilter

    values, vectors = np.linalg.eig(A)
    inverse = np.linalg.inv(vectors)
    modes = inverse @ drive
    begin = inverse @ first
    for i, value in enumerate(values):
        modes[i] = lfilter([1.0], [1.0, -value], modes[i], zi=np.array([value * begin[i]]))[0]
    return (vectors @ modes).real.T

"""Rates of the signals of one equation, where the log does not have them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def with_rates(signals: dict[str, np.ndarray], codes: np.ndarray, dt: float) -> dict[str, np.ndarray]:
    """Return signals by role, with the rates of position and pressure taken within each run where they are missing."""
    out = dict(signals)
    for rate, of in (("velocity", "position"), ("pressure_rate", "pressure")):
        if rate not in out and of in out:
            out[rate] = rate_along(out[of], codes, dt)
    return out


def rate_along(x: np.ndarray, codes: np.ndarray, dt: float) -> np.ndarray:
    """Return the rate of a signal within each run, over 40 ms.

    Parameters
    ----------
    x : array, shape (n_samples,)
        The signal.
    codes : array of int, shape (n_samples,)
        Run of each row; contiguous.
    dt : float
        Sampling interval, s.
    """
    from scipy.signal import savgol_filter

    out = np.zeros(len(x))
    borders = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    for a, b in pairwise(borders):
        # Never so long that it would smear a run of few samples.
        half = max(2, min(round(0.02 / dt), (b - a) // 200))
        width = min(2 * half + 1, (b - a) - (b - a + 1) % 2)
        if width >= 5:
            out[a:b] = savgol_filter(x[a:b], width, 3, deriv=1, delta=dt)
        elif b - a > 1:
            out[a:b] = np.gradient(x[a:b], dt)
    return out

"""Savitzky-Golay rates: the derivative of a cubic fitted in a moving window.

Savitzky and Golay (1964), DOI 10.1021/ac60214a047; cut-off: Schafer (2011), DOI 10.1109/MSP.2011.941097.
"""

from functools import lru_cache

import numpy as np

DEGREE = 3
CURVED_ENDS = True


def window_of(cutoff: float, n: int | None = None) -> int:
    """Convert a cut-off frequency to a window 2 M + 1 of degree N: Schafer's f_c ≈ (N + 1) / (3.2 M − 4.6)."""
    half = round(((DEGREE + 1) / (2.0 * cutoff) + 4.6) / 3.2)
    window = 2 * max(half, 2) + 1
    return window if n is None else min(window, n - (n + 1) % 2)


@lru_cache(maxsize=256)
def _fit(window: int) -> tuple[np.ndarray, np.ndarray]:
    """Place of each sample of a window, from -1 to 1, and the weights that give a cubic's coefficients there."""
    x = np.arange(-(window // 2), window // 2 + 1) / (window // 2)
    basis, triangle = np.linalg.qr(np.vander(x, min(DEGREE, window - 1) + 1, increasing=True))
    return x, np.linalg.solve(triangle, basis.T)


def _kernels(window: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights of value, rate and second rate at the middle of a window."""
    half, (_, weights) = window // 2, _fit(window)
    return weights[0], weights[1] / half, 2 * weights[2] / half**2


def gain(omega: np.ndarray, cutoff: float) -> np.ndarray:
    """Response of the smoothed rate divided by that of the true derivative."""
    window = window_of(cutoff)
    kernel = _kernels(window)[1]
    half = window // 2
    weights = 2 * kernel[half + 1 :]
    if half * len(omega) <= 400_000:
        return np.sin(np.outer(omega, np.arange(1, half + 1))) @ weights / omega
    size = 1 << int(np.ceil(np.log2(16 * window)))
    padded = np.zeros(size)
    padded[1 : half + 1] = weights
    response = -np.fft.rfft(padded).imag
    return np.interp(omega, np.linspace(0, np.pi, len(response)), response) / omega


def smooth(y: np.ndarray, cutoff: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smooth and differentiate at a unit step."""
    from scipy.signal import oaconvolve

    n = len(y)
    window = window_of(cutoff, n)
    half = window // 2
    centre = y.mean(axis=0)
    y = y - centre
    results = []
    for order, kernel in enumerate(_kernels(window)):
        first, last = (_cubic(part, window, order) for part in (y[:window], y[-window:]))
        inner = oaconvolve(y, kernel[::-1, None], mode="valid", axes=0)
        results.append(np.concatenate([first[:half], inner, last[half + 1 :]]))
    return results[0] + centre, results[1], results[2]


def _cubic(y: np.ndarray, window: int, order: int) -> np.ndarray:
    """Values of the cubic of one window, or of its derivative, at the window's samples."""
    x, weights = _fit(window)
    derivative = np.polynomial.polynomial.polyder(weights @ y, order, axis=0)
    return np.polynomial.polynomial.polyval(x, derivative).T / (window // 2) ** order


def rate_over(x: np.ndarray, dt: float, half: int, order: int = 1) -> np.ndarray:
    """Return a derivative of one run by a cubic over a window of fixed length, not tuned to the noise."""
    from scipy.signal import savgol_filter

    width = min(2 * half + 1, len(x) - (len(x) + 1) % 2)
    if width >= 5:
        return np.asarray(savgol_filter(x, width, DEGREE, deriv=order, delta=dt))
    out = np.asarray(x, dtype=float)
    for _ in range(order):
        out = np.gradient(out, dt) if len(out) > 1 else np.zeros(len(out))
    return out

"""How much to smooth for the best rate: Stein's unbiased estimate of the error of the derivative."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .noise import noise_level

_BINS = 1500
_LENGTHS = 8
"""Lengths of runs whose bins and gains are kept at a time."""
Gain = Callable[[np.ndarray, float], np.ndarray]


class Spectrum(NamedTuple):
    """Power of one signal over frequency, in bins."""

    omega: np.ndarray
    """Frequency, rad per sample. Shape (n_bins,)."""
    power: np.ndarray
    """Sum of squared coefficients in each bin, unit of the signal squared. Shape (n_bins,)."""
    number: np.ndarray
    """Number of coefficients in each bin, shape (n_bins,)."""
    variance: float
    """Noise variance, unit of the signal squared."""


def spectrum(y: np.ndarray, sigma: float | None = None, ends: int = 5) -> Spectrum:
    """Return the sine spectrum of a signal less the cubic that meets its value and curvature at both ends."""
    from scipy.fft import dst

    y = np.asarray(y, dtype=float)
    n = len(y)
    sigma = noise_level(y) if sigma is None else sigma
    coefficients = dst((y - _end_cubic(y, ends))[1:-1], type=1, norm="ortho")
    omega, edges, count = _bins(n)
    power = _without_chance(np.add.reduceat(coefficients**2, edges), count, sigma**2)
    return Spectrum(omega, power, count, sigma**2)


@lru_cache(maxsize=_LENGTHS)
def _bins(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean frequency, first coefficient and number of coefficients of each bin, for n samples."""
    m = n - 2
    omega = np.pi * np.arange(1, m + 1) / (n - 1)
    if m > _BINS:
        edges = np.unique(np.concatenate([np.arange(400), np.geomspace(400, m, _BINS - 399).astype(int)]))[:-1]
    else:
        edges = np.arange(m)
    count = np.diff(np.append(edges, m)).astype(float)
    return np.add.reduceat(omega, edges) / count, edges, count


@lru_cache(maxsize=_LENGTHS)
def _gains(gain: Gain, n: int, cutoffs: tuple[float, ...]) -> list[np.ndarray]:
    """Gains at each cut-off, in half-cycles per sample, for n samples: signals and runs of one length share them."""
    return [gain(_bins(n)[0], cutoff) for cutoff in cutoffs]


def _end_cubic(y: np.ndarray, ends: int) -> np.ndarray:
    """The cubic with the value and curvature that the signal has at both ends."""
    n = len(y)
    k = max(2, min(ends, n // 4))
    degree = 3 if k >= 8 else 1
    x = np.arange(k) / (k - 1)
    (y0, c0), (y1, c1) = (
        (fit[-1], 2 * fit[-3] / (k - 1) ** 2 if degree == 3 else 0.0)
        for fit in (np.polyfit(x, part, degree) for part in (y[:k], y[::-1][:k]))
    )
    s = np.arange(n) / (n - 1)
    span = float(n - 1) ** 2
    curved = c0 * ((1 - s) ** 3 - (1 - s)) + c1 * (s**3 - s)
    return y0 + (y1 - y0) * s + span / 6.0 * curved


def _without_chance(power: np.ndarray, count: np.ndarray, variance: float) -> np.ndarray:
    """Replace the power by that of the noise in bands less than four standard errors and a tenth above it."""
    m = len(power)
    bands = np.unique(np.concatenate([np.arange(min(16, m)), np.geomspace(16, max(m, 17), 60).astype(int)]))
    bands = bands[bands < m]
    total, number = np.add.reduceat(power, bands), np.add.reduceat(count, bands)
    excess = total - number * variance
    seen = excess > variance * np.maximum(4.0 * np.sqrt(2.0 * number), 0.1 * number)
    return np.where(np.repeat(seen, np.diff(np.append(bands, m))), power, count * variance)


def derivative_risk(s: Spectrum, g: np.ndarray) -> float:
    """Estimate the squared error of a smoother's rate: Stein's unbiased Σ ω² (G² |Y|² − 2 G (|Y|² − σ²)) + const.

    C. M. Stein, The Annals of Statistics 9(6), 1981. https://doi.org/10.1214/aos/1176345632
    """
    return float(np.sum(s.omega**2 * (g * g * s.power - 2 * g * (s.power - s.number * s.variance))))


def tune(
    signals: Sequence[np.ndarray],
    periods: Sequence[float],
    gain: Gain,
    noises: Sequence[float] | None = None,
    *,
    curved_ends: bool = False,
) -> float:
    """Choose the cut-off frequency with the least estimated error of the rate over all runs."""
    longest = max(len(y) for y in signals)
    cutoffs = np.geomspace(min(0.2, max(1.0 / longest, 2e-4)), 0.4, 48) / min(periods)
    if noises is None:
        noises = [noise_level(y) for y in signals]
    runs = [(y, h, s) for y, h, s in zip(signals, periods, noises, strict=True) if len(y) >= 8]
    lengths, steps = [len(y) for y, *_ in runs], [h for _, h, _ in runs]
    chosen = _least_risk([spectrum(y, s) for y, _, s in runs], lengths, steps, gain, cutoffs)
    if not curved_ends:
        return chosen
    # Over about a period of that cut-off the signal is close to a cubic, which gives its curvature at the ends.
    refined = [spectrum(y, s, round(1.0 / (chosen * h))) for y, h, s in runs]
    # The ends count too much with the line and too little with the cubic: the middle of the two is taken.
    return float(np.sqrt(chosen * _least_risk(refined, lengths, steps, gain, cutoffs)))


def _least_risk(
    spectra: list[Spectrum], lengths: list[int], periods: list[float], gain: Gain, cutoffs: np.ndarray
) -> float:
    risks = np.zeros(len(cutoffs))
    for s, n, period in zip(spectra, lengths, periods, strict=True):
        gains = _gains(gain, n, tuple(min(float(c) * period, 0.45) for c in cutoffs))
        risks += [derivative_risk(s, g) / period**2 for g in gains]
    return float(cutoffs[int(np.argmin(risks))] if risks.any() else cutoffs[-1])

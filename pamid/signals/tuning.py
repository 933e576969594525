"""How much to smooth for the best rate: Stein's unbiased estimate of the error of the derivative."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .noise import noise_level

_BINS = 1500
Gain = Callable[[np.ndarray, float], np.ndarray]


class Spectrum(NamedTuple):
    """Power of one signal over frequency, in bins.

    Parameters
    ----------
    omega : ndarray, shape (n_bins,)
        Frequency, rad per sample.
    power : ndarray, shape (n_bins,)
        Sum of squared coefficients in each bin, unit of the signal squared.
    number : ndarray, shape (n_bins,)
        Number of coefficients in each bin.
    variance : float
        Noise variance, unit of the signal squared.
    """

    omega: np.ndarray
    power: np.ndarray
    number: np.ndarray
    variance: float


def spectrum(y: np.ndarray) -> Spectrum:
    """Take the sine spectrum of a signal less the line through its ends.

    Parameters
    ----------
    y : ndarray, shape (n_samples,)
        Signal sampled at equal steps.

    Returns
    -------
    Spectrum
        The binned spectrum.

    Notes
    -----
    Without the line the odd continuation of the signal is smooth at both ends, so its spectrum holds no power that
    only the ends make. The ends are short means, or their noise would tilt the line.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.tuning import spectrum
    >>> s = spectrum(np.sin(np.arange(1000) * 0.1))
    >>> bool(abs(s.omega[np.argmax(s.power)] - 0.1) < 0.01)
    True
    """
    from scipy.fft import dst

    y = np.asarray(y, dtype=float)
    n = len(y)
    sigma = noise_level(y)
    k = min(5, max(1, n // 8))
    fit = [np.polyfit(np.arange(k), part, min(1, k - 1)) for part in (y[:k], y[::-1][:k])]
    first, last = (f[-1] for f in fit)
    inner = (y - first - (last - first) * np.arange(n) / (n - 1))[1:-1]
    coefficients = dst(inner, type=1, norm="ortho")
    m = len(coefficients)
    omega = np.pi * np.arange(1, m + 1) / (m + 1)
    if m > _BINS:
        edges = np.unique(np.concatenate([np.arange(400), np.geomspace(400, m, _BINS - 399).astype(int)]))[:-1]
    else:
        edges = np.arange(m)
    count = np.diff(np.append(edges, m)).astype(float)
    power = np.add.reduceat(coefficients**2, edges)
    power = _without_chance(power, count, sigma**2)
    return Spectrum(np.add.reduceat(omega, edges) / count, power, count, sigma**2)


def _without_chance(power: np.ndarray, count: np.ndarray, variance: float) -> np.ndarray:
    """Replace the power by that of the noise in bands where nothing else is seen.

    The derivative weighs high frequencies, where chance alone would decide; a band counts as signal where its power
    is four standard errors and a tenth above the noise.
    """
    m = len(power)
    bands = np.unique(np.concatenate([np.arange(min(16, m)), np.geomspace(16, max(m, 17), 60).astype(int)]))
    bands = bands[bands < m]
    total, number = np.add.reduceat(power, bands), np.add.reduceat(count, bands)
    excess = total - number * variance
    seen = excess > variance * np.maximum(4.0 * np.sqrt(2.0 * number), 0.1 * number)
    return np.where(np.repeat(seen, np.diff(np.append(bands, m))), power, count * variance)


def derivative_risk(s: Spectrum, gain: Gain, cutoff: float) -> float:
    """Estimate the squared error of the rate that a smoother gives, up to a constant.

    Parameters
    ----------
    s : Spectrum
        Spectrum of the signal.
    gain : callable
        ``gain(omega, cutoff)``: response of the smoothed rate, divided by that of the true derivative.
    cutoff : float
        Cut-off frequency, cycles per sample.

    Returns
    -------
    float
        Sum over the samples of the squared error of the rate less a constant that no smoother changes,
        unit of the signal squared per sample squared.

    Notes
    -----
    With the power |Y|² of the signal and noise of variance σ², an unbiased estimate of
    Σ ω² |G Y − S|² is Σ ω² (G² |Y|² − 2 G (|Y|² − σ²)) + const: Stein's unbiased risk estimate for a linear
    smoother (DOI 10.1214/aos/1176345632), taken for the derivative.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.savgol import gain
    >>> from pamid.signals.tuning import derivative_risk, spectrum
    >>> rng = np.random.default_rng(0)
    >>> s = spectrum(np.sin(np.arange(4000) * 0.01) + 0.05 * rng.standard_normal(4000))
    >>> derivative_risk(s, gain, 0.01) < derivative_risk(s, gain, 0.2)
    True
    """
    g = gain(s.omega, cutoff)
    return float(np.sum(s.omega**2 * (g * g * s.power - 2 * g * (s.power - s.number * s.variance))))


def candidate_cutoffs(n: int, count: int = 48) -> np.ndarray:
    """List the cut-off frequencies that a signal of n samples can bear.

    Parameters
    ----------
    n : int
        Number of samples.
    count : int, default=48
        Number of candidates.

    Returns
    -------
    ndarray, shape (count,)
        Cycles per sample, from one cycle in the whole signal, and no less than 1/5000, to 0.4.

    Examples
    --------
    >>> from pamid.signals.tuning import candidate_cutoffs
    >>> candidate_cutoffs(1000)[[0, -1]].round(3).tolist()
    [0.001, 0.4]
    """
    return np.geomspace(min(0.2, max(1.0 / n, 2e-4)), 0.4, count)


def tune(signals: Sequence[np.ndarray], periods: Sequence[float], gain: Gain) -> float:
    """Choose the cut-off frequency with the least estimated error of the rate over all trajectories.

    Parameters
    ----------
    signals : sequence of ndarray, shape (n_samples,)
        One signal over several trajectories, each sampled at equal steps.
    periods : sequence of float
        Sampling period of each, s.
    gain : callable
        Gain of the method, see `derivative_risk`.

    Returns
    -------
    float
        Cut-off frequency, Hz.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.savgol import gain
    >>> from pamid.signals.tuning import tune
    >>> rng = np.random.default_rng(0)
    >>> t = np.arange(4000) * 1e-3
    >>> cutoff = tune([np.sin(2 * np.pi * t) + 1e-3 * rng.standard_normal(4000)], [1e-3], gain)
    >>> 1 < cutoff < 20
    True
    """
    longest = max(len(y) for y in signals)
    finest = min(periods)
    cutoffs = candidate_cutoffs(longest) / finest
    risks = np.zeros(len(cutoffs))
    for y, period in zip(signals, periods, strict=True):
        if len(y) < 8:
            continue
        s = spectrum(y)
        risks += [derivative_risk(s, gain, min(float(c) * period, 0.45)) / period**2 for c in cutoffs]
    if not risks.any():
        return float(cutoffs[-1])
    return float(cutoffs[int(np.argmin(risks))])

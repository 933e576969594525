"""The noise of a channel, estimated from its own log: changes between samples that no smooth motion explains."""

from typing import Annotated, NamedTuple

import numpy as np

from ..explained import explained_fields
from ..signals.noise import DIFFERENCE, third_differences, white_noise

_SINGLE = 3e-7  # rounding of a difference of steps of numbers in single precision, as a share of the largest


@explained_fields
class ChannelNoise(NamedTuple):
    """Noise of one channel in one run, in the unit of the channel.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.equations import channel_noise
    >>> F = 40 + np.random.default_rng(0).normal(0, 0.3, 2000)  # N
    >>> noise = channel_noise(F, 20)
    >>> print(f"{noise.white:.1f} N a sample, {noise.variance(np.full(20, 1 / 20)) ** 0.5:.2f} N in a mean of 20")
    0.3 N a sample, 0.07 N in a mean of 20
    """

    white: Annotated[float, "Standard deviation of what averages out over a window."]
    resolution: Annotated[float, "Step of the quantisation; 0 if the values show none."]
    fixed: Annotated[
        float,
        "Standard deviation of what does not average out: the quantisation error of a signal that rests between "
        "two steps with too little noise to dither them.",
    ]

    def variance(self, weights: np.ndarray) -> float:
        """Return the variance that the noise leaves in a sum of samples with these weights."""
        return float(self.white**2 * (weights @ weights) + self.fixed**2 * weights.sum() ** 2)

    def covariance(self, weights: np.ndarray, lag: int) -> float:
        """Return the covariance of two such sums, the second one some samples later; the variance at lag 0."""
        if not lag:
            return self.variance(weights)
        return float(self.white**2 * (weights[lag:] @ weights[:-lag])) if lag < len(weights) else 0.0


def roughness(x: np.ndarray, at: np.ndarray) -> float:
    """Return how far samples at places ``at`` are from a smooth signal, root mean square, in their unit."""
    found = third_differences(x, at)
    return float(np.sqrt(np.mean(np.square(found)))) / DIFFERENCE if len(found) else 0.0


def noise_beside(x: np.ndarray, drive: np.ndarray, noise: ChannelNoise, at: np.ndarray | None = None) -> ChannelNoise:
    """Return the noise of a channel without the jitter that its noisy controller drives it with."""
    steps, cause = third_differences(x, at), third_differences(drive, at)
    power = float(cause @ cause)
    if len(steps) < 10 or power == 0.0:
        return noise
    left = steps - float(steps @ cause) / power * cause
    sigma = white_noise(left)
    least = max(sigma, noise.resolution / np.sqrt(12.0))
    return noise._replace(white=least) if least < 0.5 * noise.white else noise


def _least(differences: np.ndarray, beyond: float) -> float:
    """Return the smallest size above a limit, infinity if there is none."""
    sizes = np.abs(differences)
    least = float(sizes.min())
    if least > beyond:
        return least
    return float(np.min(sizes[sizes > beyond], initial=np.inf))


def channel_noise(x: np.ndarray, n: int, at: np.ndarray | None = None) -> ChannelNoise:
    r"""Estimate the noise of a channel over one run.

    The third difference cancels all motion that is smooth over four samples; its median absolute deviation ignores
    the few samples at which a command jumps. Quantisation by a step d adds d²/12; it averages out over a window if
    noise dithers it (all but exp(−2π²σ²/d²)) or if the signal sweeps over several steps within the window.

    Parameters
    ----------
    x : array, shape (n_samples,)
        The channel.
    n : int
        Samples per window.
    at : array, shape (n_samples,), optional
        Places of the samples, in steps; equal steps by default.

    Returns
    -------
    ChannelNoise
        The estimate.

    References
    ----------
    B. Widrow, I. Kollár, "Quantization Noise", Cambridge University Press, 2008.
    https://doi.org/10.1017/CBO9780511754661

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.equations import channel_noise
    >>> t = np.arange(0, 2, 1e-3)
    >>> P = 3e5 + 1e5 * np.sin(4 * t) + np.random.default_rng(0).normal(0, 60, t.size)  # Pa
    >>> bool(55 < channel_noise(P, 20).white < 65)
    True
    """
    x = np.asarray(x, dtype=float)
    if len(x) < 5:
        return ChannelNoise(0.0, 0.0, 0.0)
    steps = np.diff(x)
    changes = np.diff(steps)
    third = np.diff(changes) if at is None else third_differences(x, at)
    sigma = white_noise(third)
    most = float(max(x.max(), -x.min()))
    # In steady motion all steps are long: then they differ from each other by the resolution.
    least, finer = _least(steps, 1e-12 * most), _least(changes, _SINGLE * most)
    resolution = finer if finer < 0.5 * least else least
    resolution = resolution if np.isfinite(resolution) else 0.0
    rounding = resolution / np.sqrt(12.0)
    if sigma < 2.0 * resolution:  # a median of a few steps says little; the mean square of all but the jumps does
        limit = 4.0 * DIFFERENCE * max(sigma, resolution / 2.0)
        sigma = float(np.sqrt(np.mean(np.square(third[np.abs(third) <= limit])))) / DIFFERENCE
    dither = np.sqrt(max(sigma**2 - rounding**2, 0.0))
    if resolution == 0.0:
        return ChannelNoise(sigma, 0.0, 0.0)
    swept = float(np.mean(np.abs(x[n:] - x[:-n]))) / resolution if len(x) > n else 0.0
    left = float(np.exp(-2.0 * (np.pi * dither / resolution) ** 2)) / max(1.0, swept)
    return ChannelNoise(max(sigma, rounding), resolution, rounding * left)

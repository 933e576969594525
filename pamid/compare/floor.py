"""What the sensors' own noise would leave of a perfect model's error."""

from collections.abc import Callable

import numpy as np

from ..signals.state import STATE_SIGNALS
from .protocol import Prepared


def noise_floor(
    prepared: Prepared,
    predict: Callable[[np.ndarray], np.ndarray],
    rows: np.ndarray,
    target: np.ndarray,
    method: str = "savgol",
) -> float:
    r"""Estimate the error of a perfect model from the noise of the channels and the gains g of the rate filter.

    .. math:: \sigma^2 = \sigma_y^2 g_y + \sum_s \left(\frac{\partial f}{\partial s}\right)^2 \sigma_s^2 g_s
    """
    if set(prepared.cutoffs) != {"eps", "P"}:
        return float("nan")
    table, source = prepared.table, prepared.source
    noise = {s: _noise(prepared, source[s].to_numpy(dtype=float)) for s in ("eps", "P")}
    period = _period(prepared)
    window = max(1, round(prepared.window / period))
    value_gain, _ = _gains(prepared.cutoffs["P"], period, method, window)
    sigma = {
        "eps": noise["eps"],
        "deps": noise["eps"] * np.sqrt(_gains(prepared.cutoffs["eps"], period, method, window)[1]),
        "P": noise["P"],
        "dP": noise["P"] * np.sqrt(_gains(prepared.cutoffs["P"], period, method, window)[1]),
    }
    own = _noise(prepared, target) ** 2 * (value_gain if prepared.smoothed else 1.0 / window)
    x = table[list(STATE_SIGNALS)].to_numpy(dtype=float)[rows]
    variance = np.full(len(rows), own)
    for k, name in enumerate(STATE_SIGNALS):
        step = max(sigma[name], 1e-3 * float(np.std(x[:, k])))
        if step <= 0:
            continue
        shift = np.zeros(4)
        shift[k] = step
        variance += ((predict(x + shift) - predict(x - shift)) / (2 * step) * sigma[name]) ** 2
    return float(np.sqrt(np.mean(variance)))


def _noise(prepared: Prepared, x: np.ndarray) -> float:
    """Root mean square of a channel's noise over the runs."""
    from ..equations import channel_noise

    indices = prepared.source.groupby("trajectory", sort=False).indices.values()
    found = [(channel_noise(x[rows], 20), len(rows)) for rows in indices]
    total = sum((n.white**2 + n.fixed**2) * count for n, count in found)
    return float(np.sqrt(total / sum(count for _, count in found)))


def _period(prepared: Prepared) -> float:
    steps = np.diff(prepared.source["time"].to_numpy(dtype=float))
    return float(np.median(steps[steps > 0]))


def _gains(cutoff: float, period: float, method: str, window: int) -> tuple[float, float]:
    """Squared norms of the weights on samples of a filtered value, and, per s², of its rate, averaged over a window."""
    from ..signals import differentiate

    n = 2 * max(200, min(20_000, int(4 / (cutoff * period)))) + 1
    impulse = np.zeros(n)
    impulse[n // 2] = 1.0
    value, rate = differentiate(impulse, sampling_period=period, tuning=cutoff, method=method)
    box = np.full(window, 1.0 / window)
    value, rate = np.convolve(value, box), np.convolve(rate, box)
    return float(value @ value), float(rate @ rate)

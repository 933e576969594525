"""Length of the windows of rates: short for the fastest motion, and long enough that noise does not hide it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...equations.windows import kernel
from ...errors import ShortTrajectoryError
from ...simulators.port_log import PortLog

LEAST_WINDOWS = 400
"""Windows in a log, where its rows allow as many."""
POWER, PER_PERIOD = 0.9, 6.0
"""Share of the power of what is modelled that lies below a frequency, and windows in its period."""
HIDDEN = 0.1
"""Share of what is modelled up to which a window's noise hides nothing of interest."""


class Rate(NamedTuple):
    """The rate of an equation."""

    modelled: np.ndarray
    """The modelled rate, shape (n_rows,)."""
    order: int
    """Order of the derivative that is measured."""
    noise: float
    """Standard deviation of the reading's noise, in the unit of the reading."""


def samples(rates: Sequence[Rate], log: PortLog) -> int:
    """Return the samples in a window: several per period of the fastest motion, more where noise hides the rates."""
    shortest = most = most_samples(log)
    for rate in rates:
        shortest = min(shortest, longest_window(rate.modelled, log))
    n = max(1, shortest, min(most, 3 if log.n > 3 * LEAST_WINDOWS else 1))
    told = _told(n, rates, log.dt)
    while n < most and np.any(told * n < HIDDEN**-2):
        longer = min(most, n + max(1, n // 4))
        more = _told(longer, rates, log.dt)
        if np.prod(more / np.maximum(told, 1e-300)) <= 1.0:
            break
        n, told = longer, more
    return n


def most_samples(log: PortLog) -> int:
    """Return the samples of a window of which a log and each of its runs hold enough."""
    return max(1, min(log.n // LEAST_WINDOWS, min(e - a for a, e in log.spans) // 8))


def longest_window(x: np.ndarray, log: PortLog) -> int:
    """Return the samples of the longest window in which the fastest motion of a signal is not averaged away."""
    frequency = _top_frequency(x, log)
    return max(1, round(1.0 / (PER_PERIOD * frequency * log.dt))) if frequency > 0.0 else log.n


def no_windows(log: PortLog, n: int) -> ShortTrajectoryError:
    """Return the error of a log that holds no window of n samples: its runs are too short, or too much is missing."""
    longest = max(b - a for a, b in log.spans)
    if (missing := float(np.mean(log.lost))) > 0.0 and longest >= 2 * n:
        return ShortTrajectoryError(
            f"Readings are missing in {100 * missing:.1f} % of the rows, and each of {longest // n:,} windows of {n} "
            "samples has too long a gap.",
            f"windows without gaps of more than {n // 4} rows",
            "Fill in the missing readings or map columns with fewer gaps.",
        )
    return ShortTrajectoryError(
        f"The longest run of the log has {longest} rows, too few for a window of {n} samples.",
        "longer runs, or runs with more motion",
        "Record longer runs.",
    )


def window_noise(noise: float, n: int, order: int, dt: float) -> float:
    """Return the noise of a derivative over a window."""
    weights = np.concatenate([kernel(n, order + 1), np.zeros(order)])
    for _ in range(order):
        weights = np.diff(weights, prepend=0.0)
    return noise * float(np.linalg.norm(weights)) / dt**order


def _told(n: int, rates: Sequence[Rate], dt: float) -> np.ndarray:
    """Return for each equation the power of the modelled rate over that of its noise, per sample of the log."""
    power = [float(np.var(np.convolve(r.modelled, kernel(n, r.order + 1), "valid"))) for r in rates]
    noise = [max(window_noise(r.noise, n, r.order, dt), 1e-150) for r in rates]
    return np.array([p / (s * s) / n for p, s in zip(power, noise, strict=True)])


def _top_frequency(x: np.ndarray, log: PortLog) -> float:
    """Return the frequency, Hz, below which most of the power of a signal lies, over its longest run."""
    a, b = max(log.spans, key=lambda s: s[1] - s[0])
    part = x[a:b] - np.mean(x[a:b])
    power = np.cumsum(np.square(np.abs(np.fft.rfft(part))))
    if not power[-1] > 0.0:
        return 0.0
    at = int(np.searchsorted(power, POWER * power[-1]))
    return float(np.fft.rfftfreq(b - a, log.dt)[max(at, 1)])

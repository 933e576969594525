"""What depends on the path of a signal, not on time: its reversals, and what follows it with play."""

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


def reversals(x: np.ndarray) -> np.ndarray:
    """Return the rows at which a signal reverses, with its first and last row."""
    moved = np.flatnonzero(np.diff(x))
    sign = np.sign(x[moved + 1] - x[moved])
    turned = moved[1:][sign[1:] != sign[:-1]]
    return np.unique(np.concatenate([[0], turned, [len(x) - 1]]))


def play(x: np.ndarray, width: float, starts: Sequence[int] | np.ndarray = (0,)) -> np.ndarray:
    r"""Follow a signal with a play of ± w, :math:`y_k = \min(\max(y_{k-1}, x_k - w), x_k + w)`, in log₂ n passes."""
    low, high = x - width, x + width
    first = np.asarray(starts, dtype=int)
    low[first] = high[first] = x[first]
    shift = 1
    while shift < len(x) and not np.array_equal(low, high):  # until every row is known, wherever the play began
        new_low = np.minimum(np.maximum(low[:-shift], low[shift:]), high[shift:])
        new_high = np.minimum(np.maximum(high[:-shift], low[shift:]), high[shift:])
        low[shift:], high[shift:] = new_low, new_high
        shift *= 2
    return low


_DITHER = 3.0
"""Reversals smaller than this many standard deviations of the noise are ignored."""
_ASIDE = 4.0
"""Standard deviations of the noise that a reading lies beside a smooth path by chance in one of 16,000 rows."""


def steady_path(position: np.ndarray, starts: np.ndarray, sigma: ArrayLike, width: int) -> np.ndarray:
    """Return a position without noisy turns: a parabola over ``width`` samples, noise √(2.25 / width), then a play."""
    from scipy.signal import savgol_filter

    out = np.array(position, dtype=float)
    spans = list(pairwise([*np.asarray(starts).tolist(), len(out)]))
    for (a, b), noise in zip(spans, np.broadcast_to(np.asarray(sigma, dtype=float), len(spans)), strict=True):
        x, left = out[a:b], float(noise)
        odd = min(2 * (width // 2) + 1, (b - a) - (b - a + 1) % 2)
        if odd >= 5 and left > 0.0:
            smooth = savgol_filter(x, odd, 2)
            # Where a motion jumps, no parabola follows it: that would turn before the motion does.
            x = np.where(np.abs(smooth - x) > _ASIDE * left, x, smooth)
            left *= float(np.sqrt(2.25 / odd))
        if left > 0.0 and len(reversals(x)) > max(8, 0.02 * len(x)):
            # Forwards a play turns late, backwards in time as much too early.
            x = 0.5 * (play(np.array(x), _DITHER * left) + play(x[::-1].copy(), _DITHER * left)[::-1])
        out[a:b] = x
    return out


class Turns(NamedTuple):
    """Where the columns of a path turn, run by run; a lane is one column of one run."""

    values: np.ndarray
    """The signal where it turns, its first and last value included; lanes of fewer turns stay at their last. Shape
    (n_turns, n_lanes)."""
    last: np.ndarray
    """Place of the last turn before each row in ``values``, raveled. Shape (n, ...)."""
    before: np.ndarray
    """The signal there, shape (n, ...)."""


class Path:
    """A signal along runs, for functions of its path alone."""

    def __init__(self, position: np.ndarray, starts: np.ndarray) -> None:
        self.position, self.starts = np.asarray(position, dtype=float), np.asarray(starts, dtype=np.int64)

    @cached_property
    def turns(self) -> Turns:
        """Where it turns."""
        columns = self.position.reshape(len(self.position), -1)
        spans = list(pairwise([*self.starts.tolist(), len(columns)]))
        lanes = [(a, b, c) for a, b in spans for c in range(columns.shape[1])]
        rows = [reversals(columns[a:b, c]) for a, b, c in lanes]
        values = np.empty((max(map(len, rows)), len(lanes)))
        last = np.empty(columns.shape, dtype=np.int64)
        for k, ((a, b, c), turned) in enumerate(zip(lanes, rows, strict=True)):
            values[: len(turned), k] = columns[a:b, c][turned]
            values[len(turned) :, k] = values[len(turned) - 1, k]
            last[a:b, c] = len(lanes) * (np.searchsorted(turned, np.arange(b - a), side="left") - 1).clip(0) + k
        place = last.reshape(self.position.shape)
        return Turns(values, place, values.ravel()[place])


def turns_back(x: np.ndarray, starts: np.ndarray) -> bool:
    """Return whether a path reverses at least once per run; within 1 % of its range it may be noise."""
    slack = 0.01 * float(np.ptp(x)) if len(x) else 0.0
    runs = [run for run in np.split(x, starts[1:]) if len(run) > 1]
    return sum(len(reversals(play(run, slack))) - 2 for run in runs) >= len(starts)

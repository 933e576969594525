r"""Windows over which equations are averaged, and the test functions that keep derivatives off noisy signals.

An equation with m time derivatives is tested against the B-spline of order m + 1, the box of the window's width folded
m times with itself. Every derivative then moves onto the test function, by parts and without remainder:

.. math:: \int B_{m+1}\, x^{(m)}\,\mathrm{d}t = \Delta^{-m}\,\delta^m \bar x

the m-th difference of window means. No filter is involved whose error could pose as a gap, and a derivative costs no
more noise than the difference of two means. All equations share one grid of windows; for m > 0 the test functions of
neighbours overlap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from ..remembered import Remembered
from .noise import ChannelNoise

WINDOW = 0.02
"""Width of a window, s."""
_KEPT = 24  # weighted sums whose covariances are kept for fits to come


def samples_per_window(dt: float) -> int:
    """Return the number of samples in a window, at least one."""
    return max(1, round(WINDOW / dt))


@cache
def kernel(n: int, order: int) -> np.ndarray:
    """Return the weights of the B-spline of an order on samples; they add to one."""
    box = np.full(n, 1.0 / n)
    weights = box
    for _ in range(order - 1):
        weights = np.convolve(weights, box)
    weights.setflags(write=False)
    return weights


def span(n: int, order: int) -> int:
    """Return the number of samples under the B-spline of an order."""
    return order * (n - 1) + 1


def starts(n_rows: int, n: int, order: int, shift: int = 0) -> np.ndarray:
    """Return the first rows of the test functions of all windows that lie inside a series."""
    first = np.arange(0, max(n_rows, 0) + n, n) - ((order - 1) * (n - 1)) // 2 + shift
    return first[(first >= 0) & (first + span(n, order) <= n_rows)]


def average(x: np.ndarray, n: int, order: int, first: np.ndarray, contiguous: bool | None = None) -> np.ndarray:
    """Return the weighted means of a series under the test functions that begin at ``first``."""
    if not len(first):
        return np.zeros((0, *x.shape[1:]))
    # Windows follow one another: cut into blocks of one window, a test function is a few weights on as many blocks.
    begin, m = int(first[0]), len(first)
    if m > 1 and not ((first[1:] - first[:-1] == n).all() if contiguous is None else contiguous):
        place, rest = np.divmod(first - begin, n)
        if not rest.any():  # some windows of one grid: all of them at once cost less than those one by one
            return average(x, n, order, np.arange(begin, int(first[-1]) + 1, n), True)[place]
        return np.stack([np.tensordot(kernel(n, order), x[k : k + span(n, order)], axes=(0, 0)) for k in first])
    rows, columns = (m + order - 1) * n, int(np.prod(x.shape[1:], dtype=int))
    part = x[begin : begin + rows].reshape(-1, columns)
    if len(part) < rows:  # the last test function ends within its last block
        part = np.concatenate([part, np.zeros((rows - len(part), columns))])
    parts = np.ascontiguousarray(part).reshape(m + order - 1, n * columns) @ _blocks(n, order, columns)
    parts = parts.reshape(m + order - 1, order, columns)
    total = parts[:m, 0]
    for k in range(1, order):
        total = total + parts[k : k + m, k]
    return total.reshape(m, *x.shape[1:])


@cache
def _blocks(n: int, order: int, columns: int) -> np.ndarray:
    """Return the matrix that maps blocks of samples to the pieces of their means."""
    weights = np.zeros(order * n)
    weights[: span(n, order)] = kernel(n, order)
    out = np.zeros((n, columns, order, columns))
    for k in range(columns):
        out[:, k, :, k] = weights.reshape(order, n).T
    return out.reshape(n * columns, order * columns)


def centre(x: np.ndarray, n: int, order: int, first: np.ndarray) -> np.ndarray:
    """Return the values of a series at the centres of the test functions that begin at ``first``."""
    return x[first + (span(n, order) - 1) // 2]


class Bridge(NamedTuple):
    """How a column came to equal steps."""

    at: np.ndarray
    samples: np.ndarray
    """Places of what was read, in steps, and what was read. Shape (n_samples,)."""
    given: np.ndarray
    """Rows at which it was read, shape (n_rows,)."""
    mix: csr_array
    """What each sample contributes to each row, shape (n_rows, n_samples)."""
    hidden: float
    """Standard deviation of what the signal does between samples beyond its straight line, in its unit."""
    torn: np.ndarray
    """Rows of holes in which it jumped, shape (n_rows,)."""


@dataclass
class Windows:
    """The windows of one stretch: means over present samples, test functions of derivatives over bridged ones."""

    n: int
    order: int
    """Samples per window and order of the test functions."""
    first: np.ndarray
    """Their first rows, shape (n_windows,)."""
    n_rows: int
    """Rows of the stretch."""
    given: np.ndarray | None = None
    """Rows that count, for order 1; all by default. Shape (n_rows, n_sides)."""
    parts: tuple[slice, ...] = (slice(None),)
    """The windows of each stretch, where several are joined."""
    _covariances: Remembered[np.ndarray] = field(default_factory=lambda: Remembered(_KEPT), repr=False)
    _time: np.ndarray | None = field(default=None, repr=False)

    def mean(self, x: np.ndarray) -> np.ndarray:
        """Return the weighted means of a series, shape (n_rows, ...)."""
        if self.given is None:
            return average(x, self.n, self.order, self.first, self._contiguous)
        return average(np.where(self.given, x, 0.0), self.n, self.order, self.first) / self._share

    def time(self, time: np.ndarray) -> np.ndarray:
        """Return the centres of the windows, s: those of the first times that are given, which all simulators share."""
        if self._time is None:
            self._time = average(time, self.n, self.order, self.first)
        return self._time

    def centre(self, x: np.ndarray) -> np.ndarray:
        """Return the values of a series at the centres."""
        return centre(x, self.n, self.order, self.first)

    @cached_property
    def _share(self) -> np.ndarray:
        return average(np.asarray(self.given, dtype=float), self.n, self.order, self.first)

    @cached_property
    def _contiguous(self) -> bool:
        return bool((np.diff(self.first) == self.n).all())

    def covariances(
        self, channel: str, weights: np.ndarray, noise: Sequence[ChannelNoise], bridges: Sequence[Bridge] | None
    ) -> np.ndarray:
        """Return the noise of a channel in its weighted sums, with the windows that follow."""
        if bridges is None and self.given is None and self._contiguous:
            found = [[[one.covariance(weights, lag * self.n) for one in noise]] for lag in range(self.order)]
            return np.array(found)
        key = (channel, weights.tobytes())
        return self._covariances.get(key, lambda: self._sparse_covariances(weights, noise, bridges))

    def _sparse_covariances(
        self, weights: np.ndarray, noise: Sequence[ChannelNoise], bridges: Sequence[Bridge] | None
    ) -> np.ndarray:
        m, length = len(self.first), len(weights)
        begin = self.first - (length - span(self.n, self.order) - self.order + 1) // 2
        rows = np.clip(begin[:, None] + np.arange(length), 0, self.n_rows - 1)
        sides = len(noise) if self.given is None else self.given.shape[1]
        out = np.zeros((self.order, m, sides))
        for k in range(sides):
            one = noise[min(k, len(noise) - 1)]
            bridge = None if bridges is None else bridges[min(k, len(bridges) - 1)]
            values = np.broadcast_to(weights, (m, length))
            if self.given is not None:
                values = values * self.given[rows, k] / self._share[:, k, None]
            W = csr_array((values.ravel(), rows.ravel(), np.arange(0, rows.size + 1, length)), (m, self.n_rows))
            samples = W if bridge is None else W @ bridge.mix
            for lag in range(self.order):
                out[lag, : m - lag, k] = one.white**2 * _products(samples, lag)
            out[0, :, k] += one.fixed**2 * values.sum(axis=1) ** 2
            if bridge is not None and bridge.hidden > one.white:
                lost = ~bridge.given
                ends = (W[:, lost] @ bridge.mix[lost]) if lost.any() else samples * 0.0
                out[0, :, k] += (bridge.hidden**2 - one.white**2) * (_products(W[:, lost], 0) + _products(ends, 0))
        return out


def _products(W: csr_array, lag: int) -> np.ndarray:
    """Return the products of each row with the one so much later."""
    m = W.shape[0]
    return np.asarray(W[: m - lag].multiply(W[lag:]).sum(axis=1)).ravel()

r"""Windows over which equations are averaged, and the test functions that keep derivatives off noisy signals.

An equation with m time derivatives is tested against the B-spline of order m + 1, the box of the window's width folded
m times with itself. Every derivative then moves onto the test function, by parts and without remainder:

.. math:: \int B_{m+1}\, x^{(m)}\,\mathrm{d}t = \Delta^{-m}\,\delta^m \bar x

the m-th difference of window means. No filter is involved whose error could pose as a gap, and a derivative costs no
more noise than the difference of two means. All equations share one grid of windows; for m > 0 the test functions of
neighbours overlap.
"""

from __future__ import annotations

from functools import cache

import numpy as np

WINDOW = 0.02
"""Width of a window, s."""


def samples_per_window(dt: float, window: float = WINDOW) -> int:
    """Return the number of samples in a window, at least one.

    Examples
    --------
    >>> from pamid.equations.windows import samples_per_window
    >>> samples_per_window(1e-3)  # windows of 20 ms at 1 kHz
    20
    """
    return max(1, round(window / dt))


@cache
def kernel(n: int, order: int) -> np.ndarray:
    """Return the weights of the B-spline of an order on samples; they add to one.

    Examples
    --------
    >>> from pamid.equations.windows import kernel
    >>> kernel(2, 2)
    array([0.25, 0.5 , 0.25])
    """
    box = np.full(n, 1.0 / n)
    weights = box
    for _ in range(order - 1):
        weights = np.convolve(weights, box)
    weights.setflags(write=False)
    return weights


def span(n: int, order: int) -> int:
    """Return the number of samples under the B-spline of an order.

    Examples
    --------
    >>> from pamid.equations.windows import span
    >>> span(20, 1), span(20, 2)
    (20, 39)
    """
    return order * (n - 1) + 1


def starts(n_rows: int, n: int, order: int, shift: int = 0) -> np.ndarray:
    """Return the first rows of the test functions of all windows that lie inside a series.

    Parameters
    ----------
    n_rows : int
        Length of the series.
    n : int
        Samples per window; window k begins at sample k n.
    order : int
        Order of the B-spline, centred on its window.
    shift : int, default=0
        Row of the series that sample 0 would have.

    Examples
    --------
    >>> from pamid.equations.windows import starts
    >>> starts(100, 20, 1)
    array([ 0, 20, 40, 60, 80])
    """
    first = np.arange(0, max(n_rows, 0) + n, n) - ((order - 1) * (n - 1)) // 2 + shift
    return first[(first >= 0) & (first + span(n, order) <= n_rows)]


def average(x: np.ndarray, n: int, order: int, first: np.ndarray) -> np.ndarray:
    """Return the weighted means of a series under the test functions that begin at ``first``.

    Parameters
    ----------
    x : array, shape (n_rows, ...)
        The series, time along the first axis.
    n, order : int
        Samples per window and order of the B-spline.
    first : array of int
        First rows, as `starts` gives them.

    Returns
    -------
    array, shape (len(first), ...)
        The means.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.equations.windows import average
    >>> average(np.arange(8.0), 4, 1, np.array([0, 4]))
    array([1.5, 5.5])
    """
    if not len(first):
        return np.zeros((0, *x.shape[1:]))
    # Windows follow one another: cut into blocks of one window, a test function is a few weights on as many blocks.
    begin, m = int(first[0]), len(first)
    if m > 1 and not (first[-1] - begin == (m - 1) * n and (first[1:] - first[:-1] == n).all()):
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
    """Return what turns blocks of samples of several columns into the pieces of their means, as one product."""
    weights = np.zeros(order * n)
    weights[: span(n, order)] = kernel(n, order)
    out = np.zeros((n, columns, order, columns))
    for k in range(columns):
        out[:, k, :, k] = weights.reshape(order, n).T
    return out.reshape(n * columns, order * columns)


def centre(x: np.ndarray, n: int, order: int, first: np.ndarray) -> np.ndarray:
    """Return the values of a series at the centres of the test functions that begin at ``first``.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.equations.windows import centre
    >>> centre(np.arange(8.0), 4, 1, np.array([0, 4]))
    array([1., 5.])
    """
    return x[first + (span(n, order) - 1) // 2]

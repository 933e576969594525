"""Stretches of a signal over which it repeats one reading, as a stuck or clipped sensor does."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np


def equal_stretches(x: np.ndarray, codes: np.ndarray | None = None) -> list[tuple[int, int]]:
    """Cut a signal into stretches of one reading each.

    Parameters
    ----------
    x : ndarray, shape (n_samples,)
        A signal, in any unit; each missing reading is a stretch of its own.
    codes : ndarray, shape (n_samples,), optional
        Trajectory of each sample; no stretch crosses a border.

    Returns
    -------
    list of (int, int)
        First row of each stretch and the row after its last.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.stretches import equal_stretches
    >>> equal_stretches(np.array([1.0, 1.0, 2.0, 2.0, 2.0]), np.array([0, 0, 0, 0, 1]))
    [(0, 2), (2, 4), (4, 5)]
    """
    if not len(x):
        return []
    changes = np.diff(x) != 0
    if codes is not None:
        changes |= np.diff(codes) != 0
    edges = np.flatnonzero(np.concatenate([[True], changes, [True]]))
    return list(pairwise(edges.tolist()))


def stuck_rows(
    x: np.ndarray,
    moves: Callable[[int, int], bool],
    codes: np.ndarray | None = None,
    *,
    longer_than: int | None = None,
) -> np.ndarray:
    """Return the rows in which a reading repeats one value for long while something else moves.

    By default a stretch is long that lasts more than 20 rows and more than ten times the median stretch, and a signal
    that never changes, or has fewer than 50 rows, counts as constant rather than stuck.

    Parameters
    ----------
    x : ndarray, shape (n_samples,)
        A signal, in any unit.
    moves : callable
        Says of two rows whether something moves from the first to before the second.
    codes : ndarray, shape (n_samples,), optional
        Trajectory of each sample.
    longer_than : int, optional
        Rows that a stretch must have more of, of any signal, in place of the default.

    Returns
    -------
    ndarray of bool, shape (n_samples,)
        The rows: the sensor is stuck or clipped there.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.stretches import stuck_rows
    >>> x = np.where(np.arange(200) < 100, np.random.default_rng(0).normal(size=200), 4.2)
    >>> int(stuck_rows(x, lambda a, b: True).sum())
    100
    """
    out = np.zeros(len(x), dtype=bool)
    if longer_than is None and (len(x) < 50 or np.nanmax(x) == np.nanmin(x)):
        return out
    stretches = equal_stretches(x, codes)
    long = max(20.0, 10.0 * float(np.median([b - a for a, b in stretches]))) if longer_than is None else longer_than
    for a, b in stretches:
        if b - a > long and moves(a, b):
            out[a:b] = True
    return out

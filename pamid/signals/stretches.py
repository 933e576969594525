"""Stretches of a signal over which it repeats one reading, as a stuck or clipped sensor does."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np


def stretches_of(rows: np.ndarray) -> list[tuple[int, int]]:
    """Return the stretches of rows that are true, each as its first row and the one behind its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(rows).astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def equal_stretches(x: np.ndarray, codes: np.ndarray | None = None) -> list[tuple[int, int]]:
    """Cut a signal into stretches of one reading each."""
    if not len(x):
        return []
    changes = np.asarray(x[1:] != x[:-1])
    if codes is not None:
        changes |= codes[1:] != codes[:-1]
    edges = np.flatnonzero(np.concatenate([[True], changes, [True]]))
    return list(pairwise(edges.tolist()))


def stuck_rows(
    x: np.ndarray, moves: Callable[[int, int], bool], codes: np.ndarray | None = None, *, longer_than: int | None = None
) -> np.ndarray:
    """Return the rows in which a reading repeats one value for long while something else moves."""
    out = np.zeros(len(x), dtype=bool)
    if longer_than is None and (len(x) < 50 or np.nanmax(x) == np.nanmin(x)):
        return out
    stretches = equal_stretches(x, codes)
    long = max(20.0, 10.0 * float(np.median([b - a for a, b in stretches]))) if longer_than is None else longer_than
    for a, b in stretches:
        if b - a > long and moves(a, b):
            out[a:b] = True
    return out

"""Curves of a run, thinned to what a picture can show: a spike of one row is drawn as high as it is."""

import numpy as np

_COLUMNS = 700
"""Pixel columns of a panel at twice the resolution of a screen: more points change nothing in a picture."""
_GAP = 5.0
"""Sampling intervals without a row across which nothing is drawn."""


def drawn(time: np.ndarray, *curves: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return curves as drawn, times first: the least and greatest of each pixel column, NaN in gaps."""
    piece = _pieces(time)
    rows = _extremes(time, piece, curves)
    gaps = np.flatnonzero(np.diff(piece[rows])) + 1
    return tuple(np.insert(np.asarray(c, dtype=float)[rows], gaps, np.nan) for c in (time, *curves))


def _extremes(time: np.ndarray, piece: np.ndarray, curves: tuple[np.ndarray, ...]) -> np.ndarray:
    if len(time) <= 2 * _COLUMNS:
        return np.arange(len(time))
    column = np.floor(_COLUMNS * (time - time[0]) / max(time[-1] - time[0], 1e-300)).astype(int)
    cell = column + (_COLUMNS + 1) * piece
    kept = [np.array([0, len(time) - 1])]
    for y in curves:
        rows = np.flatnonzero(np.isfinite(y))
        order = rows[np.lexsort((y[rows], cell[rows]))]
        ends = np.flatnonzero(np.diff(cell[order], prepend=-1, append=cell[-1] + 1))
        kept += [order[ends[:-1]], order[ends[1:] - 1]]
    return np.unique(np.concatenate(kept))


def _pieces(time: np.ndarray) -> np.ndarray:
    """Return the number of gaps before each row."""
    if len(time) < 3:
        return np.zeros(len(time), dtype=int)
    steps = np.diff(time)
    return np.concatenate([[0], np.cumsum(steps > _GAP * np.median(steps))])

"""Thinning of logs: every k-th row, or a maximum number of rows."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pamid.errors import ParameterError
from pamid.explained import explained_by

from ._rows import blocks


def thinned_rows(
    groups: np.ndarray, every: int | None = None, *, n_rows: int | None = None, across: bool = False
) -> np.ndarray:
    """Choose rows at equal distances.

    Parameters
    ----------
    groups : array_like, shape (n_samples,)
        Run of each row; the rows of each are contiguous.
    every : int, optional
        Distance between kept rows.
    n_rows : int, optional
        Instead: at most so many rows in all.
    across : bool, default=False
        Whether to count across the borders of runs; otherwise the first row of each is kept.

    Returns
    -------
    ndarray of int
        Positions of the kept rows, increasing.

    Raises
    ------
    ParameterError
        If not exactly one of `every` and `n_rows` is a positive number.

    Examples
    --------
    >>> from pamid.signals import thinned_rows
    >>> thinned_rows(["a"] * 5 + ["b"] * 4, 3).tolist()
    [0, 3, 5, 8]
    """
    groups = np.asarray(groups, dtype=object)
    if (every is None) == (n_rows is None):
        raise ParameterError(f"every is {every} and n_rows is {n_rows}.", "exactly one of the two", "Give one of them.")
    given = every if every is not None else n_rows
    if not isinstance(given, int | np.integer) or given < 1:
        raise ParameterError(f"{'every' if n_rows is None else 'n_rows'} is {given!r}.", "a number >= 1", "Correct it.")
    lengths = [rows.stop - rows.start for _, rows in blocks(groups)]
    if every is None:
        if n_rows < (1 if across else len(lengths)):  # type: ignore[operator]
            raise ParameterError(
                f"n_rows is {n_rows} for {len(lengths)} runs.",
                "at least one row per run",
                "Allow more rows, or set across=True.",
            )
        total = [len(groups)] if across else lengths
        every = max(1, -(-len(groups) // n_rows))  # type: ignore[operator]
        while sum(-(-n // every) for n in total) > n_rows:  # type: ignore[operator]
            every += 1
    if across:
        return np.arange(0, len(groups), every)
    if not lengths:
        return np.arange(0)
    return np.concatenate([np.arange(rows.start, rows.stop, every) for _, rows in blocks(groups)])


@explained_by(thinned_rows)
def thin(
    log: pd.DataFrame, every: int | None = None, *, n_rows: int | None = None, across: bool = False
) -> pd.DataFrame:
    """Keep every k-th row of each run of a log.

    Parameters
    ----------
    log : DataFrame
        Tidy frame; take rates first, since they need the neighbours that thinning removes.

    Returns
    -------
    DataFrame
        The kept rows, renumbered.

    Raises
    ------
    ParameterError
        If not exactly one of `every` and `n_rows` is a positive number.

    Examples
    --------
    >>> import pandas as pd
    >>> from pamid.signals import thin
    >>> log = pd.DataFrame({"trajectory": ["a"] * 300, "time": range(300)})
    >>> len(thin(log, 100)), len(thin(log, n_rows=7))
    (3, 7)
    """
    groups = log["trajectory"].to_numpy(dtype=object) if "trajectory" in log.columns else np.zeros(len(log))
    return log.iloc[thinned_rows(groups, every, n_rows=n_rows, across=across)].reset_index(drop=True)


def spaced(n: int, count: int, *, at_most: bool = False) -> slice:
    """Return every k-th of n items, starting with the first."""
    return slice(None, None, max(1, -(-n // count) if at_most else n // count))


def whole_trajectories(log: pd.DataFrame, most: int, rows: Sequence[slice] | None = None) -> pd.DataFrame:
    """Return runs spread evenly over a log, each whole, up to `most` rows in all; the last one is cut there."""
    if len(log) <= most:
        return log
    if rows is None:
        rows = [r for _, r in blocks(log["trajectory"].to_numpy(dtype=object))]
    chosen = (rows[k] for k in spread_evenly([r.stop - r.start for r in rows], most))
    return log.iloc[np.concatenate([np.arange(r.start, min(r.stop, r.start + most)) for r in chosen])[:most]]


def spread_evenly(lengths: Sequence[int] | np.ndarray, most: int) -> list[int]:
    """Return the numbers of runs spread evenly over a log, with about the requested number of rows in all."""
    count = min(max(1, len(lengths) * most // max(int(np.sum(lengths)), 1)), len(lengths))
    return [int(k) for k in np.linspace(0, len(lengths) - 1, count).round()]

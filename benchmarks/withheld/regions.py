"""How well the regions that a diagnosis names agree with where a gap truly is."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

HELD = 0.8
"""Share of the gap's energy that the true region holds."""


def true_region(contribution: np.ndarray, held: float = HELD) -> np.ndarray:
    """Return the smallest set of windows that holds a share of each side's energy, as a mask."""
    if contribution.ndim > 1:
        return np.column_stack([true_region(side, held) for side in contribution.T])
    energy = np.square(contribution)
    order = np.argsort(-energy, kind="stable")
    total = np.cumsum(energy[order])
    if not len(total) or total[-1] <= 0:
        return np.zeros(contribution.shape, dtype=bool)
    mask = np.zeros(energy.size, dtype=bool)
    mask[order[: int(np.searchsorted(total, held * total[-1])) + 1]] = True
    return mask.reshape(contribution.shape)


def spoken_of(queries: Sequence[str], sides: int) -> list[int]:
    """Return the muscles that queries speak of: those whose columns (``eps1``, ``P2``) they read, or all."""
    muscles = {int(k) - 1 for query in queries for k in re.findall(r"\b[A-Za-z_]+([12])\b", query)}
    return sorted(muscles) if muscles and sides > 1 else list(range(sides))


def named_region(table: pd.DataFrame, queries: Sequence[str], centres: np.ndarray) -> np.ndarray:
    """Return the windows that queries name, as a mask.

    Parameters
    ----------
    table : DataFrame
        One row a sample, with the columns that the queries read.
    queries : sequence of str
        pandas queries.
    centres : array of int
        Rows at the centres of the windows.
    """
    rows, table = np.zeros(len(table), dtype=bool), table.reset_index(drop=True)
    for query in queries:
        rows[table.query(query).index.to_numpy()] = True
    return rows[centres]


def agreement(table: pd.DataFrame, queries: Sequence[str], centres: np.ndarray, true: np.ndarray) -> float:
    """Return the F1 of named regions, over the windows of the muscles that they speak of; both muscles are alike.

    Without a region the gap is said to be everywhere.

    Parameters
    ----------
    table : DataFrame
        One row a sample, with the columns that the queries read.
    queries : sequence of str
        pandas queries.
    centres : array of int
        Rows at the centres of the windows.
    true : array of bool, shape (windows, sides)
        The true region.
    """
    sides = true.shape[1]
    scores = []
    for side in spoken_of(queries, sides):
        own = [q for q in queries if side in spoken_of([q], sides)]
        named = named_region(table, own, centres) if own else np.ones(len(centres), dtype=bool)
        scores.append(f1(named, true[:, side]))
    return float(np.mean(scores))


def f1(named: np.ndarray, true: np.ndarray) -> float:
    """Return the harmonic mean of precision and recall; 0 if nothing agrees."""
    hits = float(np.sum(named & true))
    return 2.0 * hits / float(np.sum(named) + np.sum(true)) if hits else 0.0

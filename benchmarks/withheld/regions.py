"""How well the regions that a diagnosis names agree with where a gap truly is."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

HELD = 0.8
"""Share of the gap's energy that the true region holds."""


def true_region(contribution: np.ndarray, held: float = HELD) -> np.ndarray:
    """Return the smallest set of windows that holds a share of the energy, as a mask."""
    energy = np.square(contribution).ravel()
    order = np.argsort(-energy, kind="stable")
    total = np.cumsum(energy[order])
    if not len(total) or total[-1] <= 0:
        return np.zeros(contribution.shape, dtype=bool)
    mask = np.zeros(energy.size, dtype=bool)
    mask[order[: int(np.searchsorted(total, held * total[-1])) + 1]] = True
    return mask.reshape(contribution.shape)


def named_region(table: pd.DataFrame, queries: Sequence[str], centres: np.ndarray, sides: int) -> np.ndarray:
    """Return the windows that queries name, as a mask of shape (windows, sides).

    A query on columns of one muscle alone (``eps1``, ``P1``) speaks of that muscle; any other one of both.

    Parameters
    ----------
    table : DataFrame
        One row a sample, with the columns that the queries read.
    queries : sequence of str
        pandas queries.
    centres : array of int
        Rows at the centres of the windows.
    sides : int
        2 for an equation of the muscles, 1 for the joint.
    """
    mask = np.zeros((len(centres), sides), dtype=bool)
    for query in queries:
        rows = np.zeros(len(table), dtype=bool)
        rows[table.reset_index(drop=True).query(query).index.to_numpy()] = True
        muscles = {int(k) - 1 for k in re.findall(r"\b[A-Za-z_]+([12])\b", query)}
        side = slice(None) if sides == 1 or len(muscles) != 1 else min(muscles)
        mask[:, side] |= rows[centres] if isinstance(side, int) else rows[centres][:, None]
    return mask


def f1(named: np.ndarray, true: np.ndarray) -> float:
    """Return the harmonic mean of precision and recall; 0 if nothing agrees."""
    hits = float(np.sum(named & true))
    return 2.0 * hits / float(np.sum(named) + np.sum(true)) if hits else 0.0

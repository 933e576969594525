"""Readings exactly at the end of a sensor's range."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .stretches import stretches_of

_SELDOM = 0.05
"""Share of equal neighbours elsewhere up to which a short row of equal readings is significant."""
_IN_A_ROW = 4
"""Consecutive rows at the largest size that are not chance: `_SELDOM` cubed is one in eight thousand. It takes more of
them for as small a chance where more neighbours are equal."""


class End(NamedTuple):
    """The end of a sensor's range."""

    limit: float
    """The largest size that it reads."""
    rows: np.ndarray
    """Rows that stand there, shape (n,)."""
    surprise: float
    """Logarithm of how unlikely each of them is for readings that end nowhere."""
    side: int = 0
    """1 or -1 for the upper or lower end of a sensor that reads farther on the other side, else 0."""


def end_of(x: np.ndarray, spans: Sequence[tuple[int, int]]) -> End | None:
    """Return the end of a sensor's range, if readings that otherwise rarely repeat are exactly there."""
    for side, size in ((0, np.abs(x)), (1, x), (-1, -x)):
        farther = side != 0 and np.max(size, initial=0.0) < np.max(-size, initial=0.0)
        if (side == 0 or farther) and (end := _standing(x, size, spans)) is not None:
            return end._replace(side=side)
    return None


def _standing(x: np.ndarray, size: np.ndarray, spans: Sequence[tuple[int, int]]) -> End | None:
    """Return the largest end; at the border of a run, or with coarse steps, a reading must stand longer to count."""
    limit = float(np.max(size, initial=0.0))
    at, rows = size == limit, np.zeros(len(x), dtype=bool)
    equal, pairs, longest = 0, 0, 0
    for a, b in spans:
        alike = (x[a : b - 1] == x[a + 1 : b]) & ~at[a : b - 1]
        equal += int(np.sum(alike))
        pairs += int(np.sum(~(at[a : b - 1] & at[a + 1 : b])))
        longest = max([longest, *(stop - begin + 1 for begin, stop in stretches_of(alike))])
    share = max(equal, 1) / max(pairs, 1)
    if not limit > 0.0 or share**2 > _SELDOM:  # coarse readings of a smooth motion stand at its turns
        return None
    least = 1 + math.ceil((_IN_A_ROW - 1) * math.log(_SELDOM) / math.log(max(share, _SELDOM)))
    if share > _SELDOM:  # where readings often repeat, a motion may rest at its largest value, too
        least = max(least, 2 * longest)
    least = max([least, *(_longest_turn(x[a:b], float(np.min(x)), float(np.max(x))) + 1 for a, b in spans)])
    for a, b in spans:
        for begin, stop in stretches_of(at[a:b]):
            rows[a + begin : a + stop] = stop - begin >= least and begin > 0 and a + stop < b
    return End(limit, rows, float(-np.log(share))) if rows.any() else None


def _longest_turn(x: np.ndarray, least: float, most: float) -> int:
    """Return the most rows that a reading stands at a turn between its extremes."""
    begins = np.flatnonzero(np.diff(x, prepend=np.nan) != 0.0)
    rows, level = np.diff(begins, append=len(x)), x[begins]
    turns = np.diff(np.sign(np.diff(level))) != 0.0
    inner = turns & (level[1:-1] > least) & (level[1:-1] < most)
    return int(np.max(rows[1:-1][inner], initial=0))

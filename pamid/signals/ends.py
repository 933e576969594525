"""Readings exactly at the end of a sensor's range."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .stretches import stretches_of

_IN_A_ROW, _CHANCE = 4, 1.25e-4
"""Fewest consecutive rows at the largest size that are not chance, and how unlikely they are where readings that
repeat elsewhere do so independently."""


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
    """Return the largest end: readings stand there for longer than elsewhere, and than chance allows."""
    limit = float(np.max(size, initial=0.0))
    at, rows = size == limit, np.zeros(len(x), dtype=bool)
    equal, pairs, longest = 0, 0, 0
    for a, b in spans:
        same = x[a : b - 1] == x[a + 1 : b]
        equal += int(np.sum(same & ~at[a : b - 1]))
        pairs += int(np.sum(~(at[a : b - 1] & at[a + 1 : b])))
        longest = max([longest, *(stop - begin + 1 for begin, stop in stretches_of(same & ~at[a : b - 1]))])
    share = max(equal, 1) / max(pairs, 1)
    if not limit > 0.0 or share >= 1.0:
        return None
    least = max(1 + int(np.ceil(np.log(_CHANCE) / np.log(share))), _IN_A_ROW, longest + 1)
    for a, b in spans:
        for begin, stop in stretches_of(at[a:b]):
            rows[a + begin : a + stop] = stop - begin >= least and begin > 0 and a + stop < b
    return End(limit, rows, float(-np.log(share))) if rows.any() else None

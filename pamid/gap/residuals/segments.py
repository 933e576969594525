"""The stretches of a log: pieces of its runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

SHORTEST = 24
"""Least samples of a stretch."""


class Segment(NamedTuple):
    """A piece of a run."""

    first: int
    stop: int
    """Its rows."""

    @property
    def halves(self) -> list[Segment]:
        """Both halves; the whole where they would be too short."""
        if self.stop - self.first < 2 * SHORTEST:
            return [self]
        middle = (self.first + self.stop) // 2
        return [Segment(self.first, middle), Segment(middle, self.stop)]


def cut(spans: Sequence[tuple[int, int]], length: int) -> list[Segment]:
    """Return runs in pieces of about a length."""
    found = []
    for a, b in spans:
        count = max(1, round((b - a) / length))
        edges = np.linspace(a, b, count + 1).astype(int)
        found += [Segment(int(x), int(y)) for x, y in pairwise(edges)]
    return found

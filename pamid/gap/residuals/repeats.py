"""Runs that repeat each other, and the pieces of a log that are left out in turn."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations

import numpy as np

from ...simulators.port_log import PortLog
from .tolerances import rms

ALIKE, NEARLY = 0.05, 0.5
"""Most that an input, and a reading, of two runs may differ, as a share of its spread in the log, for them to repeat
each other: initial states differ, and are fitted or known anyway."""
FEW, PIECES = 3, 8
"""Runs below which pieces of them take their place, and how many of those there are in all."""


def repeating(log: PortLog, inputs: Collection[str]) -> list[tuple[int, int]]:
    """Return the pairs of runs with the same inputs over the same time and similar readings."""
    found = []
    driven = {k: ALIKE for k in inputs if k in log.channels}
    limits = {k: driven.get(k, NEARLY) * float(np.std(x)) for k, x in log.channels.items() if np.std(x) > 0.0}
    for i, j in combinations(range(len(log.spans)), 2):
        (a, b), (c, d) = log.spans[i], log.spans[j]
        n = min(b - a, d - c)
        apart = {k: log.channels[k][a : a + n] - log.channels[k][c : c + n] for k in limits}
        if limits and n >= 0.8 * max(b - a, d - c) and all(rms(apart[k]) <= most for k, most in limits.items()):
            found.append((i, j))
    return found


def pieces(
    spans: Sequence[tuple[int, int]], block: np.ndarray, time: np.ndarray, dt: float, stretch: float
) -> tuple[np.ndarray, int]:
    """Return the run, or the piece of a long one, of each window, and how many there are."""
    n = len(spans)
    if n >= FEW:
        return block, n
    out = np.zeros_like(block)
    for run, (first, stop) in enumerate(spans):
        length = (stop - first) * dt
        count = int(np.clip(length / max(stretch, 1e-300), 1, PIECES // n))
        mine = block == run
        out[mine] = run * (PIECES // n) + np.clip(time[mine] / length * count, 0, count - 1).astype(int)
    found, labels = np.unique(out, return_inverse=True)
    return labels.reshape(out.shape), len(found)

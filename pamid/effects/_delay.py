"""Delays in samples, whole or in part, of what is held and of what is smooth, for a simulation and for a log."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..signals.state import Array


def cubic(x: float, nodes: Sequence[int]) -> list[float]:
    """Return the weights of four samples in the value between them: the cubic polynomial through them."""
    return [math.prod((x - b) / (a - b) for b in nodes if b != a) for a in nodes]


def memory(samples: float) -> int:
    """Return how many past values `shift` needs for a smooth value, besides the output."""
    return max(math.ceil(samples) + 2, 4)


def shift(x: Array, value: Array, samples: float, smooth: bool = False) -> Array:
    """Push ``value`` into the memory (entry 0: output, entries 1…: newest first) and update the output."""
    out = np.empty_like(x)
    out[1] = value
    out[2:] = x[1:-1]
    whole = math.floor(samples)
    part = samples - whole
    out[0] = out[1 + whole]
    if part > 0.0 and smooth:
        nodes = range(first := max(whole - 1, 0), first + 4)  # nothing is newer than the newest
        out[0] = sum(w * out[1 + k] for w, k in zip(cubic(samples, nodes), nodes, strict=True))
    elif part > 0.0:
        out[0] += part * (out[2 + whole] - out[1 + whole])
    return out


def delayed_rows(v: Array, samples: float, starts: Array, smooth: bool = False) -> Array:
    """Return ``v`` delayed (or advanced) within each run; ends repeat, smooth signals are interpolated cubically."""
    n = len(v)
    starts = np.asarray(starts, dtype=np.int64)
    lengths = np.diff(np.append(starts, n))
    first = np.repeat(starts, lengths)
    last = np.repeat(starts + lengths - 1, lengths)
    whole = math.floor(samples)
    part = samples - whole
    rows = np.arange(n)

    def at(k: int) -> Array:
        return v[np.clip(rows - whole - k, first, last)]

    if part == 0.0:
        return at(0)
    if smooth:
        return np.asarray(sum(w * at(k) for w, k in zip(cubic(part, range(-1, 3)), range(-1, 3), strict=True)))
    return at(0) + part * (at(1) - at(0))

"""Delays in samples, whole or in part, for a simulation and for a log."""

from __future__ import annotations

import math

import numpy as np

from ..signals.state import Array


def shift(x: Array, value: Array, samples: float) -> Array:
    """Push ``value`` into the memory (entry 0: output, entries 1…: newest first) and update the output."""
    out = np.empty_like(x)
    out[1] = value
    out[2:] = x[1:-1]
    whole = math.floor(samples)
    part = samples - whole
    out[0] = out[1 + whole]
    if part > 0.0:
        out[0] += part * (out[2 + whole] - out[1 + whole])
    return out


def delayed_rows(v: Array, samples: float, starts: Array) -> Array:
    """Return ``v`` delayed (or, with a negative number, advanced) within each run; ends repeat."""
    n = len(v)
    starts = np.asarray(starts, dtype=np.int64)
    lengths = np.diff(np.append(starts, n))
    first = np.repeat(starts, lengths)
    last = np.repeat(starts + lengths - 1, lengths)
    whole = math.floor(samples)
    part = samples - whole
    rows = np.arange(n)
    near = v[np.clip(rows - whole, first, last)]
    if part == 0.0:
        return near
    return near + part * (v[np.clip(rows - whole - 1, first, last)] - near)

"""Elastic stops of several widths, the elements of a Prandtl–Ishlinskii operator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..signals.paths import play
from ..signals.state import Array

RATIOS = (1.0 / 3.0, 1.0, 3.0)
"""Widths of the elements, as multiples of the middle one."""


def stops_at(x: Array) -> Array:
    """Return stops at rest in the middle of their range, the elements along the first axis."""
    return np.zeros((len(RATIOS), *np.shape(x)))


def stopped(z: Array, moved: Array, width: float) -> Array:
    """Advance stops z ∈ [−1, 1] by a displacement in one direction."""
    widths = width * np.reshape(RATIOS, (-1, *[1] * np.ndim(moved)))
    return np.clip(z + moved / widths, -1.0, 1.0)


def stops_along(x: Array, width: float, starts: Array) -> Array:
    """Return `stopped` along the runs of a log, without a loop over time: x less its play."""
    x = np.asarray(x, dtype=float)
    return np.stack([(x - play(x, ratio * width, starts)) / (ratio * width) for ratio in RATIOS])


def stops_force(z: Array, weights: Sequence[float], slopes: Sequence[float], position: Array) -> Array:
    """Return the force of the stops, N: −Σ (w + v x) z over the elements, their weights changing with the position."""
    parts = ((w + v * position) * element for w, v, element in zip(weights, slopes, z, strict=True))
    return -sum(parts, start=np.zeros(np.shape(z[0])))

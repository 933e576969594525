"""Rough residuals, as of simulators that stick, switch or contact: longer differences, and a search without slopes.

References
----------
J. J. Moré, S. M. Wild, "Estimating derivatives of noisy simulations", ACM Transactions on Mathematical Software 38(3),
2012. https://doi.org/10.1145/2168773.2168777

T. G. Kolda, R. M. Lewis, V. Torczon, "Optimization by direct search: new perspectives on some classical and modern
methods", SIAM Review 45(3), 2003. https://doi.org/10.1137/S003614450242889
"""

from collections.abc import Callable

import numpy as np

LONGER, FARTHEST, WIDE, NARROW = 3.0, 0.3, 1.5, 1.1
"""Factor from one difference to the next, and the longest one, as a share of the parameter; factor on a parameter in
the first steps of the search without slopes, and the least one. None decides: only descents begin there."""


def longer(h: float, v: float, lower: float, upper: float, moved: Callable[[float], np.ndarray]) -> float:
    """Return the share of a parameter that shows more of a slope than of roughness; 0 if a small change h does."""
    room = min(FARTHEST * abs(v), v - lower, upper - v)
    far, here = abs(h), _size(moved, h)
    while LONGER * far <= room:
        before, here = here, _size(moved, LONGER * far)
        if 0.0 < LONGER * before <= 2.0 * here:  # a smooth change is a third as large, a rough one as large
            break
        far *= LONGER
    return far / abs(v) if far > abs(h) else 0.0


def _size(moved: Callable[[float], np.ndarray], h: float) -> float:
    """Return by how much residuals change; a limit that is out of reach one way may be within reach the other way."""
    return float(np.linalg.norm(moved(h))) or float(np.linalg.norm(moved(-h)))


def compass(
    value: Callable[[np.ndarray], float], x: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the best numbers of a search along each of them by factors, wide ones first, and what gain is chance."""
    best, factor = value(x), WIDE
    chance = abs(value(np.clip(1.001 * x, lower, upper)) - best)  # so near, little else differs

    def turned(k: int, factor: float) -> np.ndarray:
        return np.clip(np.where(np.arange(len(x)) == k, x * factor, x), lower, upper)

    while factor > NARROW:
        before = best
        for k in range(len(x)):
            for turn in (factor, 1.0 / factor):
                while not np.array_equal(trial := turned(k, turn), x) and (found := value(trial)) > best + chance:
                    x, best = trial, found
        if best == before:
            factor = float(np.sqrt(factor))
    return x, chance

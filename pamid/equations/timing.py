"""When a signal changes within one sample: a timing that a log does not tell, and that must not pose as a gap."""

from collections.abc import Sequence

import numpy as np

from ..signals.noise import median

_UNSURE = 0.3
"""Standard deviation of the share of a change that comes early or late, before a log is seen."""


def timed(value: np.ndarray, change: np.ndarray, most: float, parts: Sequence[slice]) -> np.ndarray:
    """Return residuals with the part of a change within a sample that leaves least of them, chosen for each run."""
    return np.concatenate([value[part] + _share(value[part], change[part], most) * change[part] for part in parts])


def _share(value: np.ndarray, change: np.ndarray, most: float) -> float:
    """Return the part that leaves least; a run in which hardly anything changes does not tell it: then none."""
    if len(value) < 3:
        return 0.0
    step = change - change.mean(axis=0)
    unsure = median(np.square(np.diff(value, axis=0)).ravel()) / _UNSURE**2
    power = float(np.sum(step**2)) + unsure
    return float(np.clip(-np.sum(step * value) / power, 0.0, most)) if power > 0 else 0.0

"""Sensors that stand still: a channel that was never quite at rest while all was well, and now is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

LEAST_READINGS = 5
"""Samples that must be equal before a channel counts as still."""


class StillSensors:
    """Find stuck sensors; a channel that rested on the healthy stretch is never called stuck."""

    def __init__(self, block: int) -> None:
        self.block = block
        self.rests: set[str] = set()
        self.stuck: dict[str, float] = {}

    def learn(self, channels: Mapping[str, np.ndarray]) -> StillSensors:
        """Note which channels rest while all is well, each of shape (n_samples,)."""
        self.rests = {name for name, x in channels.items() if any(_still(x[b]) for b in self._blocks(len(x)))}
        self.stuck = {}
        return self

    def update(self, channels: Mapping[str, np.ndarray], time: np.ndarray) -> dict[str, np.ndarray]:
        """Take the next samples; return which of them to leave out, each of shape (n_samples,)."""
        left_out = {}
        for name, x in channels.items():
            left_out[name] = mask = np.zeros(len(x), dtype=bool)
            if name in self.rests:
                continue
            for b in self._blocks(len(x)):
                if _still(x[b]):
                    mask[b] = True
                    self.stuck.setdefault(name, float(time[b][0]))
                elif np.isfinite(x[b]).any():
                    self.stuck.pop(name, None)
        return left_out

    def _blocks(self, n: int) -> list[slice]:
        return [slice(i, i + self.block) for i in range(0, n, self.block)]


def _still(x: np.ndarray) -> bool:
    known = x[np.isfinite(x)]
    return len(known) >= LEAST_READINGS and bool(np.ptp(known) == 0.0)

"""Rows of a log between readings: what their interpolation makes of noise, and of jumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Interpolated:
    """Where each row of a channel lies between two readings."""

    before: np.ndarray
    """Number of the reading before it; the next one comes after it. Shape (n,)."""
    share: np.ndarray
    """How far it lies towards that one, from 0 to 1. Shape (n,)."""
    jump: np.ndarray
    """How far it may be off where the channel jumps between the two, at an unknown instant. Shape (n,)."""

    @classmethod
    def of(cls, t: np.ndarray, x: np.ndarray, rows: np.ndarray) -> Interpolated:
        """Return where rows lie between the readings of one run."""
        before = np.clip(np.searchsorted(t, rows), 1, len(t) - 1) - 1
        share = np.clip((rows - t[before]) / np.diff(t)[before], 0.0, 1.0)
        # An instant that may be any between two readings gives a line on average, and this deviation from it.
        return cls(before, share, np.abs(_jumps(t, x))[before] * np.sqrt(share * (1.0 - share)))

    @classmethod
    def joined(cls, runs: Sequence[Interpolated]) -> Interpolated:
        """Return the rows of several runs, whose readings follow one another."""
        ends = np.cumsum([0, *(int(np.max(run.before)) + 2 for run in runs)])
        before = np.concatenate([run.before + end for run, end in zip(runs, ends[:-1], strict=True)])
        return cls(before, *(np.concatenate([getattr(run, what) for run in runs]) for what in ("share", "jump")))

    def at(self, rows: np.ndarray) -> Interpolated:
        """Return some of the rows."""
        return Interpolated(self.before[rows], self.share[rows], self.jump[rows])

    @property
    def interpolated(self) -> bool:
        """Whether any row is not a reading."""
        return bool(np.any((self.share > 0.0) & (self.share < 1.0)))

    def noise(self, rng: np.random.RandomState) -> np.ndarray:
        """Return what white noise of readings, of unit variance, is at the rows."""
        drawn = rng.standard_normal(int(np.max(self.before)) + 2)
        return np.asarray((1.0 - self.share) * drawn[self.before] + self.share * drawn[self.before + 1])


def _jumps(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return by how much a signal changes from each reading to the next beyond the changes before and after it."""
    step = np.diff(t)
    speed, out = np.diff(x) / step, np.zeros(len(step))
    if len(step) > 2:
        usual = np.median(np.stack([speed[:-2], speed[1:-1], speed[2:]]), axis=0)
        out[1:-1] = (speed[1:-1] - usual) * step[1:-1]
    return out

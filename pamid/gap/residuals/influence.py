"""How initial states act on predictions over the stretches of a log, and which of them explain an error."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

GONE = 1e-3
"""Share of an initial state's largest effect that is left once a simulator has forgotten it."""


class _OneLength(NamedTuple):
    """Stretches of as many columns."""

    stretches: np.ndarray
    columns: np.ndarray
    """Shape (n_stretches, n_columns)."""
    inverse: np.ndarray
    """What takes an error to the initial states that explain most of it, shape (n_stretches, n_states, n_errors)."""


class Influence:
    """What a unit of each initial state changes along all stretches, in units of the noise.

    The slopes have the shape (n_states, n_shown, n_columns); `of` is the stretch in which each column lies.
    """

    def __init__(self, slopes: np.ndarray, of: np.ndarray, n_stretches: int) -> None:
        self.slopes, self.of, self.n_stretches = slopes, of, n_stretches

    def explained(self, error: np.ndarray) -> np.ndarray:
        """Return the initial states that explain most of an error, shape (n_states, n_stretches)."""
        found, error = np.zeros((len(self.slopes), self.n_stretches)), np.nan_to_num(error)
        for group in self._inverses:
            own = np.moveaxis(error[:, group.columns], 0, 1).reshape(len(group.stretches), group.inverse.shape[2])
            found[:, group.stretches] = np.matmul(group.inverse, own[:, :, None])[:, :, 0].T
        return found

    def moved(self, shift: np.ndarray) -> np.ndarray:
        """Return the change by initial states, shape (n_shown, n_columns)."""
        return np.asarray(np.einsum("kjn,kn->jn", self.slopes, shift[:, self.of]))

    def apart(self, change: np.ndarray, times: float) -> np.ndarray:
        """Return what of changed initial states shows in the readings, beyond so many standard errors of noise."""
        found = np.zeros((len(self.slopes), self.n_stretches))
        for group in self._inverses:
            A = self.slopes[:, :, group.columns].transpose(2, 0, 1, 3).reshape(group.inverse.shape)
            seen = (group.inverse @ A.transpose(0, 2, 1) @ change[:, group.stretches].T[:, :, None])[:, :, 0]
            error = np.sqrt(np.sum(np.square(group.inverse), axis=2))
            found[:, group.stretches] = (np.sign(seen) * np.maximum(np.abs(seen) - times * error, 0.0)).T
        return found

    @cached_property
    def _inverses(self) -> list[_OneLength]:
        counts, found = np.bincount(self.of, minlength=self.n_stretches), []
        firsts = np.cumsum(counts) - counts
        for count in np.unique(counts) if len(self.slopes) else ():
            mine = np.flatnonzero(counts == count)
            columns = firsts[mine][:, None] + np.arange(count)
            A = self.slopes[:, :, columns].transpose(2, 0, 1, 3)
            A = A.reshape(*A.shape[:2], math.prod(A.shape[2:]))
            size = np.sqrt(np.sum(np.square(A), axis=2, keepdims=True))
            good = np.isfinite(size).all(axis=(1, 2))  # elsewhere the simulator has no values: told elsewhere
            size = np.where(size > 0.0, size, 1.0)
            # Of an unstable motion all states soon act alike: normal equations would lose what sets them apart.
            inverse = np.linalg.pinv(np.where(good[:, None, None], A / size, 0.0), rcond=1e-10).transpose(0, 2, 1)
            found.append(_OneLength(mine, columns, np.where(good[:, None, None], inverse / size, np.nan)))
        return found


def forgotten(slopes: np.ndarray) -> bool:
    """Return whether the effect of initial states, shape (n_states, n_shown, n), has died out halfway along."""
    size = np.max(np.abs(slopes), axis=1)
    return bool(np.all(np.max(size[:, size.shape[1] // 2 :], axis=1) <= GONE * np.max(size, axis=1)))


def beside(slopes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return rows with the initial states projected out."""
    O = slopes.reshape(len(slopes), math.prod(slopes.shape[1:]))  # noqa: E741 - as in the formula of shooting
    size = np.sqrt(np.sum(np.square(O), axis=1))
    Q = np.linalg.qr((O[size > 0.0] / size[size > 0.0, None]).T)[0]
    return rows - (rows @ Q) @ Q.T

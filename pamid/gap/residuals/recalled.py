"""Hidden states of which a simulator forgets how they began: what came before a stretch tells where it begins.

Readings hardly show a state that acts for a moment. Its start would explain an error by values that it never has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .influence import GONE


class Recalled(NamedTuple):
    """What is known of some states along a log, as if it were read at the first row of a stretch."""

    states: list[int]
    along: np.ndarray
    """Their values, shape (n_known, n)."""
    spread: np.ndarray
    """To how much they are known: by as much as they vary."""

    @classmethod
    def nothing(cls, n: int) -> Recalled:
        """Return that nothing is known."""
        return cls([], np.zeros((0, n)), np.zeros(0))

    def begun(self, x0: np.ndarray, firsts: np.ndarray) -> np.ndarray:
        """Return initial states of stretches with what is known of them."""
        x0 = x0.copy()
        x0[self.states] = self.along[:, firsts]
        return x0

    def error(self, x0: np.ndarray, firsts: np.ndarray) -> np.ndarray:
        """Return by how much initial states are off, in units of what is known, shape (n_known, n)."""
        found = np.zeros(self.along.shape)
        found[:, firsts] = (self.along[:, firsts] - x0[self.states]) / self.spread[:, None]
        return found

    def slopes(self, n_states: int, firsts: np.ndarray) -> np.ndarray:
        """Return the sensitivities of the same to initial states, shape (n_states, n_known, n)."""
        found = np.zeros((n_states, *self.along.shape))
        for row, (k, size) in enumerate(zip(self.states, self.spread, strict=True)):
            found[k, row, firsts] = 1.0 / size
        return found


def recalled(
    runs: Callable[[np.ndarray], np.ndarray], x0: np.ndarray, hidden: Sequence[int], spans: Sequence[tuple[int, int]]
) -> Recalled:
    """Return what whole runs tell of hidden states: from any start they are the same in their second halves.

    `runs` returns the states along them, shape (n_states, n), from initial states, shape (n_states, n_runs).
    """
    along, moved = runs(x0).copy(), x0.copy()
    spread = np.std(along, axis=1)
    moved[hidden] += spread[hidden, None]
    later = np.concatenate([np.arange((a + b) // 2, b) for a, b in spans])
    apart = np.max(np.abs(runs(moved) - along)[:, later], axis=1)
    for a, b in spans:  # nothing came before
        along[:, a] = np.mean(along[:, a:b], axis=1)
    known = [k for k in hidden if 0.0 < spread[k] < np.inf and apart[k] <= GONE * spread[k]]
    return Recalled(known, along[known], spread[known])

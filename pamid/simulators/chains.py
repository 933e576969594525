r"""Linear recurrences along runs, solved for all their steps at once.

:math:`z_{k+1} = A_k z_k + b_k` from each run's first row on is a triangular band of equations.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np


class Chains:
    """Recurrences with given matrices, shape (n_steps, n, n), over rows of runs that follow each other."""

    def __init__(self, steps: np.ndarray, firsts: np.ndarray, rows: int) -> None:
        self.steps, self.firsts, self.rows = steps, firsts, rows
        self.lasts = np.append(firsts[1:], rows)
        self.before = np.delete(np.arange(rows), self.lasts - 1)
        """Rows that another one follows."""

    @cached_property
    def _band(self) -> np.ndarray:
        """The equations of all rows as a band: each row less its step from the one before."""
        n = self.steps.shape[1]
        band = np.zeros((2 * n, self.rows, n))
        band[0] = 1.0
        for i in range(n):
            for j in range(n):
                band[n + i - j, self.before, j] = -self.steps[:, i, j]
        return np.asfortranarray(band.reshape(2 * n, -1))

    def followed(self, added: np.ndarray, start: np.ndarray | float = 0.0) -> np.ndarray:
        """Return z at each row, shape (rows, n), from what is added in each step and the values at each run's start."""
        from scipy.linalg.lapack import dtbtrs

        n = self.steps.shape[1]
        right = np.zeros((self.rows, n))
        right[self.before + 1] = added
        right[self.firsts] = start
        out = dtbtrs(self._band, right.reshape(-1, 1), uplo="L")[0].reshape(-1, n)
        if not np.isfinite(out).all():  # zero times infinity would reach the next run
            for a, b in zip(self.firsts, self.lasts, strict=True):
                own = dtbtrs(self._band[:, a * n : b * n], right[a:b].reshape(-1, 1), uplo="L")[0]
                out[a:b] = own.reshape(-1, n)
        return np.asarray(out)

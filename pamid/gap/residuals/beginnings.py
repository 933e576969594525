r"""The unknown memory of effects at the start of a run, projected out of the residuals.

A spring that creeps, or gas that cools, begins a logged run with a past that is not in the log. Its contribution decays
with a time constant τ of the effect, by an unknown amount a in each run and muscle,

.. math:: z = z_0 + \sum_i a_i\, e^{-t/\tau_i}, \qquad a_i \sim N(0, \sigma_i^2)

with σ from the largest possible memory. The amounts are integrated out: the residual keeps what no amount explains, and
half the logarithm of det(I + σ²BᵀB) is the price of that freedom.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def without_beginnings(z: np.ndarray, columns: Sequence[np.ndarray], block: np.ndarray) -> tuple[np.ndarray, float]:
    """Return residuals with the unknown initial memory projected out, and the price of that freedom."""
    k, n = len(columns), int(block.max(initial=-1)) + 1
    B = np.column_stack(columns)
    H = np.empty((n, k, k))
    for i in range(k):
        for j in range(k):
            H[:, i, j] = np.bincount(block, B[:, i] * B[:, j], minlength=n)
    H += np.eye(k)
    g = np.stack([np.bincount(block, B[:, i] * z, minlength=n) for i in range(k)], axis=1)
    amounts = np.linalg.solve(H, g[..., None])[..., 0]
    return z - np.sum(B * amounts[block], axis=1), 0.5 * float(np.sum(np.linalg.slogdet(H)[1]))

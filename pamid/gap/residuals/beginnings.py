r"""What an effect remembers when a run begins is not known: what it may add there, taken off the residuals.

A spring that creeps, or gas that cools, begins a logged run with a past that the log does not hold. What that adds
decays with a time constant τ of the effect, by an unknown amount a in each run and muscle,

.. math:: z = z_0 + \sum_i a_i\, e^{-t/\tau_i}, \qquad a_i \sim N(0, \sigma_i^2)

with σ from what the effect could remember at most. The amounts are integrated out: the residual keeps what no amount
explains, and half the logarithm of det(I + σ²BᵀB) is what that freedom costs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Beginning(NamedTuple):
    """What an effect may add at the beginning of a run.

    Parameters
    ----------
    equation : str
        The equation.
    tau : float
        Time constant of its decay, s.
    size : float
        Its standard deviation, in the unit of the equation.
    """

    equation: str
    tau: float
    size: float


def without_beginnings(z: np.ndarray, columns: Sequence[np.ndarray], block: np.ndarray) -> tuple[np.ndarray, float]:
    """Return residuals without what unknown beginnings explain, and what that freedom costs."""
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

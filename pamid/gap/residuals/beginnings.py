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
    """Return residuals without what unknown beginnings explain, and what that freedom costs.

    Parameters
    ----------
    z : array, shape (n,)
        Residuals, in units of the noise and white.
    columns : sequence of array, shape (n,)
        What each beginning adds by one standard deviation, likewise.
    block : array of int, shape (n,)
        Run and muscle of each, from 0 on; amounts differ from one to the next.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.gap.residuals.beginnings import without_beginnings
    >>> decay = 50.0 * np.exp(-np.arange(100) / 20.0)
    >>> left, cost = without_beginnings(np.concatenate([0.3 * decay, -0.7 * decay]), [np.tile(decay, 2)],
    ...                                 np.repeat([0, 1], 100))
    >>> bool(np.max(np.abs(left)) < 0.02), round(cost)
    (True, 10)
    """
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

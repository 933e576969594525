r"""The expected cost of a misfit in log-likelihood, before its noise is known.

With δ what a hypothesis leaves of the true signal in a window, in units of noise, and n the noise to come,

.. math:: \bar\rho(\delta, s) = \mathrm E_n\Big[\tfrac{\nu + 1}{2} \log\Big(1 + \frac{(\delta + n)^2}{\nu g^2 s^2}\Big)
    \Big] + \log s, \qquad n \sim N(0, 1)

with the scale s ≥ 1 of the equation that costs least, over the windows of the earlier logs as well, in which the
hypothesis leaves noise. A few windows that are far off therefore count by their logarithms, as they do in the
diagnosis (`pamid.gap.inference.student_t`).
"""

import numpy as np

from ..inference.student_t import GAUSSIAN
from ..settings import NU

SIZES = np.concatenate([[0.0], np.geomspace(0.05, 3000.0, 70)])
"""Misfits that are tabulated, in units of noise. This grid and the next cost at most 0.01 nats per window
(``benchmarks/settings.py --computed``)."""
SCALES = 1.25 ** np.arange(24)
"""Scales that an equation is tried with, up to 170."""


def _table() -> np.ndarray:
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    z2 = np.square(SIZES[:, None] + nodes)
    mean = np.log1p(z2 / (NU * GAUSSIAN**2 * np.square(SCALES)[:, None, None])) @ (weights / weights.sum())
    cost = 0.5 * (NU + 1.0) * mean + np.log(SCALES)[:, None]
    return np.asarray(cost - cost[0, 0])


TABLE = _table()
"""Cost beyond that of noise alone at scale 1, shape (n_scales, n_sizes)."""
CURVATURE = float(2.0 * TABLE[0, 1] / SIZES[1] ** 2)
"""Weight of a small misfit relative to a Gaussian likelihood."""


def expected_cost(left: np.ndarray, earlier: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the expected cost of one equation's misfit in log-likelihood, and its scale."""
    size = np.minimum(np.abs(left), SIZES[-1])
    k = np.clip(np.searchsorted(SIZES, size, side="right") - 1, 0, len(SIZES) - 2)
    f = (size - SIZES[k]) / (SIZES[k + 1] - SIZES[k])
    # A scale above that of the largest misfit costs only more.
    some = min(int(np.searchsorted(SCALES, 1.0 + float(size.max(initial=0.0)))) + 1, len(SCALES))
    # The table is linear between its sizes, so that windows need only be counted there.
    n, draws = len(SIZES), left.shape[1]
    at = (k + n * np.arange(draws)).ravel()
    counted = np.bincount(at, (1.0 - f).ravel(), n * draws) + np.bincount(at + 1, f.ravel(), n * draws)
    total = TABLE[:some] @ counted.reshape(draws, n).T + earlier * TABLE[:some, :1]
    best = np.argmin(total, axis=0)
    return np.maximum(total[best, np.arange(total.shape[1])], 0.0), SCALES[best]


def counts_for(left: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return the weights of windows in the curvature of the cost, with a misfit at a scale."""
    wide = NU * GAUSSIAN**2
    return np.asarray(CURVATURE * (wide + 1.0) / (wide * np.square(scale) + np.square(left) + 1.0))

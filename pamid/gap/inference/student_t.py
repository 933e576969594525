r"""The likelihood that candidates compete by, and the robust fit that maximises it.

Residuals in units of their noise follow Student's t with a scale of its own in each equation, never less than the
noise itself. The scale is maximised out, so that an equation weighs more the better it is explained, and the few
windows in which a command jumps do not dominate:

.. math:: \ell = -\sum_e \Big[n_e \log s_e + \tfrac{\nu + 1}{2} \sum_{w \in e} \log\big(1 + z_w^2 / (\nu s_e^2)\big)
    \Big], \qquad s_e \ge 1

References
----------
K. L. Lange, R. J. A. Little, J. M. G. Taylor, "Robust statistical modeling using the t distribution", Journal of the
American Statistical Association 84(408), 1989. https://doi.org/10.1080/01621459.1989.10478852
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..settings import NU

GAUSSIAN = 0.8563
"""Scale of a t distribution of that kind fitted to Gaussian noise of unit width."""


class RobustFit(NamedTuple):
    """A robust fit."""

    loglik: float
    """The logarithm of the likelihood."""
    x: np.ndarray
    """Coefficients of the columns, shape (n_columns,)."""
    z: np.ndarray
    """What is left, in units of the noise. Shape (n_windows,)."""
    scales: np.ndarray
    """Scale of each equation, at least 1. Shape (n_equations,)."""


def scale(z: np.ndarray, least: float = 1.0, start: float | None = None) -> float:
    """Return the maximum-likelihood scale of t-distributed residuals, such that Gaussian noise of width 1 has 1."""
    if not len(z):
        return least
    z2 = z * z / GAUSSIAN**2
    floor = max(least * least, 1e-300)
    s2 = max(floor, float(np.median(z2)) * 1.6 if start is None else start * start)
    for _ in range(50):
        # z² / (ν + z²/s²) = s² (1 − ν / (ν + z²/s²))
        new = max(floor, (NU + 1.0) * s2 * (1.0 - float(np.mean(NU / (NU + z2 / s2)))))
        if abs(new - s2) < 1e-5 * s2:
            s2 = new
            break
        s2 = new
    return float(np.sqrt(s2))


def loglik(
    z: np.ndarray, parts: Sequence[slice], weights: np.ndarray | None = None, start: np.ndarray | None = None
) -> tuple[float, np.ndarray]:
    """Return the log-likelihood of residuals in units of their noise, and the scale of each equation."""
    total, scales = 0.0, np.ones(len(parts))
    for k, part in enumerate(parts):
        s = scales[k] = scale(z[part], start=None if start is None else float(start[k]))
        terms = -len(z[part]) * np.log(s) - 0.5 * (NU + 1.0) * np.sum(
            np.log1p(np.square(z[part] / (GAUSSIAN * s)) / NU)
        )
        total += float(terms) * (1.0 if weights is None else float(weights[k]))
    return total, scales


def solve(
    z0: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    parts: Sequence[slice],
    weights: np.ndarray | None = None,
    prior: np.ndarray | None = None,
    iterations: int = 4,
    start: np.ndarray | None = None,
) -> RobustFit:
    """Maximise the likelihood of ``z0 + A x`` over bounded coefficients."""
    k = A.shape[1]
    prior = np.zeros(k) if prior is None else prior
    start = np.clip(np.zeros(k) if start is None else start, lower, upper)
    z = z0 + A @ start if np.any(start) else z0
    value, scales = loglik(z, parts, weights)
    best = RobustFit(value - 0.5 * float(prior @ (start * start)), start, z, scales)
    if not k:
        return best
    # An equation that is far off at the start would be ignored, one that fits would dominate: the first round therefore
    # trusts all equations alike, and a second one starts from the actual scales.
    for first in (np.ones(len(parts)), scales) if iterations > 5 else (np.ones(len(parts)),):
        found = _reweighted(z0, A, lower, upper, parts, weights, prior, iterations, first)
        if found.loglik > best.loglik:
            best = found
    return best


def _reweighted(
    z0: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    parts: Sequence[slice],
    weights: np.ndarray | None,
    prior: np.ndarray,
    iterations: int,
    scales: np.ndarray,
) -> RobustFit:
    w = np.empty(len(z0))
    best: RobustFit | None = None
    z = z0
    for n in range(iterations):
        for i, part in enumerate(parts):
            share = (1.0 if weights is None else float(weights[i])) / scales[i] ** 2
            # The first round trusts every window: an apparent outlier may be explained by the columns.
            w[part] = share * (NU + 1.0) / (NU + np.square(z[part] / (GAUSSIAN * scales[i]))) if n else share
        Aw = A * w[:, None]
        x = bounded(A.T @ Aw + np.diag(prior), -(z0 @ Aw), lower, upper)
        z = z0 + A @ x
        value, scales = loglik(z, parts, weights, scales if n else None)
        value -= 0.5 * float(prior @ (x * x))
        gain = np.inf if best is None else value - best.loglik
        if best is None or gain > 0.0:
            best = RobustFit(value, x, z, scales)
        if abs(gain) < 0.01:
            break
    assert best is not None
    return best


def window_weights(solution: RobustFit, parts: Sequence[slice], weights: np.ndarray | None = None) -> np.ndarray:
    """Return the weight of each window in the curvature of the likelihood at a fit."""
    w = np.empty(len(solution.z))
    for i, part in enumerate(parts):
        share = (1.0 if weights is None else float(weights[i])) / solution.scales[i] ** 2
        w[part] = share * (NU + 1.0) / (NU + np.square(solution.z[part] / (GAUSSIAN * solution.scales[i])))
    return w


def form_cost(
    A: np.ndarray, solution: RobustFit, parts: Sequence[slice], prior: np.ndarray, weights: np.ndarray | None = None
) -> float:
    """Return half the log-determinant of H / prior: Laplace's price of columns with a Gaussian prior."""
    if not A.shape[1]:
        return 0.0
    w = window_weights(solution, parts, weights)
    H = (A.T @ (A * w[:, None])) / np.sqrt(np.outer(prior, prior))
    return 0.5 * float(np.linalg.slogdet(np.eye(len(prior)) + H)[1])


def bounded(H: np.ndarray, g: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Minimise ½ xᵀHx − gᵀx within bounds, by an active set on the scaled problem."""
    k = len(g)
    size = np.sqrt(np.maximum(np.diag(H), 1e-300))
    C, b = H / np.outer(size, size) + 1e-11 * np.eye(k), g / size
    low, high = lower * size, upper * size
    x = np.clip(np.zeros(k), low, high)
    free = np.ones(k, dtype=bool)
    for _ in range(10 * k + 10):
        step = x.copy()
        if free.any():
            rest = b[free] - C[np.ix_(free, ~free)] @ x[~free]
            step[free] = np.linalg.solve(C[np.ix_(free, free)], rest)
        outside = free & ((step < low - 1e-12) | (step > high + 1e-12))
        if outside.any():
            # Go as far as the first bound allows and hold that coefficient there.
            d = step - x
            with np.errstate(divide="ignore", invalid="ignore"):
                room = np.where(d > 0, (high - x) / d, np.where(d < 0, (low - x) / d, np.inf))
            room = np.where(outside, room, np.inf)
            at = int(np.argmin(room))
            x = x + max(0.0, min(1.0, float(room[at]))) * d
            x[at] = high[at] if d[at] > 0 else low[at]
            free[at] = False
            continue
        x = step
        slope = C @ x - b
        wrong = ~free & (((x <= low) & (slope < -1e-10)) | ((x >= high) & (slope > 1e-10))) & (high > low)
        if not wrong.any():
            break
        free[int(np.argmax(np.where(wrong, np.abs(slope), -1.0)))] = True
    return np.clip(x / size, lower, upper)

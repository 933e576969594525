"""Least squares for few parameters: bounded and nonlinear, or linear and accumulated; standard errors of both.

Weights count rows: a weight of 2 is the same row twice, in the fit and in the standard errors.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from ..errors import DivergedError


class Solution(NamedTuple):
    """A fit: the parameters, their covariance and how it ended."""

    x: np.ndarray
    cost: float
    covariance: np.ndarray
    at_bound: np.ndarray
    n_iter: int
    message: str


def complex_step_jacobian(predict: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """Return ∂predict/∂x, exact to rounding, for a prediction that is an analytic function of its parameters."""
    columns = []
    for i in range(len(x)):
        step = 1e-30 * max(abs(float(x[i])), 1.0)
        shifted = x.astype(complex)
        shifted[i] += 1j * step
        columns.append(np.imag(predict(shifted)) / step)
    return np.stack(columns, axis=1)


def fit_nonlinear(
    predict: Callable[[np.ndarray], np.ndarray],
    y: np.ndarray,
    weight: np.ndarray,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    held: np.ndarray | None = None,
    clusters: np.ndarray | None = None,
    max_iter: int = 200,
) -> Solution:
    """Minimise Σ w (y − predict(x))² within bounds, with an exact Jacobian whose columns scale the steps."""
    root = np.sqrt(weight)
    # The size of the target as unit of the residual: the tolerances are then free of physical units.
    size = float(np.sqrt(np.average(y * y, weights=weight))) or 1.0
    if not np.all(np.isfinite(predict(start))):
        raise DivergedError(
            "The model's prediction is not finite at the starting parameters.",
            "finite predictions over all rows",
            "Check the units of the signals and the starting values.",
        )
    width = upper - lower
    margin = 1e-6 * np.where(np.isfinite(width), width, np.maximum(np.abs(start), 1e-12))
    inside = np.clip(start, lower + margin, upper - margin)
    moved = np.ones(len(start), dtype=bool) if held is None else ~held

    def whole(x: np.ndarray) -> np.ndarray:
        full = start.astype(x.dtype)
        full[moved] = x
        return full

    def predict_moved(x: np.ndarray) -> np.ndarray:
        return predict(whole(x))

    result = least_squares(
        lambda x: root * (predict_moved(x) - y) / size,
        inside[moved],
        jac=lambda x: root[:, None] * complex_step_jacobian(predict_moved, x) / size,
        bounds=(lower[moved], upper[moved]),
        method="dogbox",
        x_scale="jac",
        ftol=1e-15,
        xtol=1e-14,
        gtol=1e-14,
        max_nfev=max_iter,
    )
    at_bound = np.zeros(len(start), dtype=bool)
    at_bound[moved] = result.active_mask != 0
    best = whole(result.x)
    J = complex_step_jacobian(predict, best)
    covariance = _covariance(J, y - predict(best), weight, ~at_bound, clusters)
    return Solution(best, float(result.cost), covariance, at_bound, int(result.nfev), str(result.message))


def _covariance(
    J: np.ndarray, residual: np.ndarray, weight: np.ndarray, free: np.ndarray, clusters: np.ndarray | None
) -> np.ndarray:
    """Covariance of the parameters; infinite variance for one that the data do not determine or a bound holds."""
    n_all = J.shape[1]
    full = np.zeros((n_all, n_all))
    full[np.diag_indices(n_all)] = np.inf
    used = np.flatnonzero(free)
    if not used.size:
        return full
    J = J[:, used]
    scale = np.sqrt(np.sum(weight[:, None] * J * J, axis=0))
    seen = scale > 0
    used, J, scale = used[seen], J[:, seen], scale[seen]
    if not used.size:
        return full
    J = J / scale
    values, vectors = np.linalg.eigh(J.T @ (weight[:, None] * J))
    determined = values > 1e-12 * values.max()
    inverse = (vectors[:, determined] / values[determined]) @ vectors[:, determined].T
    dof = max(float(weight.sum()) - used.size, 1.0)
    if clusters is None:
        part = inverse * float(np.sum(weight * residual**2)) / dof
    else:
        numbers = np.unique(clusters, return_inverse=True)[1]
        scores = np.zeros((int(numbers.max()) + 1, used.size))
        np.add.at(scores, numbers, J * (weight * residual)[:, None])
        n_clusters = len(scores)
        factor = n_clusters / max(n_clusters - 1, 1) * (float(weight.sum()) - 1.0) / dof
        part = factor * inverse @ (scores.T @ scores) @ inverse if n_clusters > 1 else np.full_like(inverse, np.inf)
    part = part / np.outer(scale, scale)
    # what takes part in a direction that the data leave open has no finite variance
    open_share = np.sum(vectors[:, ~determined] ** 2, axis=1) if not determined.all() else np.zeros(used.size)
    full[np.ix_(used, used)] = part
    lost = used[open_share > 1e-8]
    full[lost, lost] = np.inf
    return full


def compress(factor: np.ndarray, A: np.ndarray, y: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Add rows to the triangular factor of [A | y], which holds all that a linear least-squares fit needs."""
    root = np.sqrt(weight)[:, None]
    return np.asarray(np.linalg.qr(np.vstack([factor, root * np.column_stack([A, y])]), mode="r"))


def solve(factor: np.ndarray, total_weight: float) -> Solution:
    """Return the least-squares solution (of least norm in scaled columns) and its covariance."""
    R, z = factor[:, :-1], factor[:, -1]
    scale = np.linalg.norm(R, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    U, s, Vt = np.linalg.svd(R / scale, full_matrices=False)
    kept = s > 1e-12 * s.max(initial=0.0)
    V = Vt[kept].T
    x = V @ ((U[:, kept].T @ z) / s[kept])
    residual = z - (R / scale) @ x
    dof = max(total_weight - R.shape[1], 1.0)
    covariance = (V / s[kept] ** 2) @ V.T * float(residual @ residual) / dof / np.outer(scale, scale)
    lost = 1.0 - np.sum(V * V, axis=1) > 1e-8
    covariance[lost, lost] = np.inf
    return Solution(
        x / scale,
        0.5 * float(residual @ residual),
        covariance,
        np.zeros(len(x), dtype=bool),
        1,
        f"rank {int(kept.sum())}",
    )


def cluster_covariance(A: np.ndarray, residual: np.ndarray, weight: np.ndarray, clusters: np.ndarray) -> np.ndarray:
    """Return the cluster-robust covariance of the coefficients of a linear fit."""
    return _covariance(A, residual, weight, np.ones(A.shape[1], dtype=bool), clusters)

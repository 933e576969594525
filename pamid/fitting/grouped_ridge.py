r"""Ridge regression whose penalty is what predicts groups best that it has not seen.

.. math:: w = \arg\min \|B S^{-1} w - r\|^2 + \lambda \|w\|^2

with S the root mean square of each column; every λ is judged by predicting each fold from the others.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class GroupedRidge(NamedTuple):
    """A fitted ridge regression."""

    held_out: np.ndarray
    """Prediction of each row from the other folds; zero where no penalty predicts better than nothing. Shape (n,)."""
    weights: np.ndarray
    """Weights fitted to all rows; zero likewise. Shape (n_columns,)."""
    share: float
    """Share of the mean square that `held_out` explains, at least 0."""


def grouped_ridge(B: np.ndarray, r: np.ndarray, folds: np.ndarray, ridges: Sequence[float]) -> GroupedRidge:
    """Fit a ridge regression."""
    names = np.unique(folds)
    H = np.array([B[folds == k].T @ B[folds == k] for k in names])
    g = np.array([B[folds == k].T @ r[folds == k] for k in names])
    whole_H, whole_g = H.sum(axis=0), g.sum(axis=0)
    scale = np.sqrt(np.maximum(np.diag(whole_H) / max(len(r), 1), 1e-12))

    def solved(H: np.ndarray, g: np.ndarray, ridge: float) -> np.ndarray:
        A = H / np.outer(scale, scale) + ridge * np.eye(len(scale))
        return np.asarray(np.linalg.solve(A, g / scale) / scale)

    power = float(np.mean(np.square(r))) if len(r) else 0.0
    best, chosen, least = np.zeros(len(r)), None, power
    for ridge in ridges:
        predicted = np.empty(len(r))
        for k, name in enumerate(names):
            predicted[folds == name] = B[folds == name] @ solved(whole_H - H[k], whole_g - g[k], ridge)
        left = float(np.mean(np.square(r - predicted)))
        if left < least:
            best, chosen, least = predicted, ridge, left
    weights = np.zeros(B.shape[1]) if chosen is None else solved(whole_H, whole_g, chosen)
    return GroupedRidge(best, weights, max(1.0 - least / power, 0.0) if power > 0 else 0.0)

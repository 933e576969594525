"""What could be predicted of a residual at all, and which way effects act on the target: before any cause is named."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ...signals.paths import reversals
from ..residuals.single import SignalEvidence
from .sensitivity import Template
from .student_t import bounded

LAGS = (0.02, 0.1, 0.5, 2.0)
"""Ages of the past signals that the learner reads, s."""
FOLDS = 5
_ROWS = 12_000
_CLEARLY = 0.05  # share of the power by which the other sense must explain more


class Floor(NamedTuple):
    """What is left of a residual on held-out trajectories by the best of several learners.

    Parameters
    ----------
    rms : float
        Its root mean square, in the target's unit.
    left : array, shape (n_windows,)
        What is left at each window.
    """

    rms: float
    left: np.ndarray


LEAST = 200
"""Windows below which a forest learns nothing that a single effect does not."""


def explainable_floor(evidence: SignalEvidence, found: Iterable[Template], seed: int = 0) -> Floor:
    """Return what a flexible learner leaves of a residual on held-out trajectories.

    The learner is a boosted forest on the same signals, their past and the path since the last reversal; or the best
    single effect of the library; or the forest on what that effect leaves. Trajectories are held out, or stretches of
    time where there are less than three.

    Parameters
    ----------
    evidence : SignalEvidence
        The log.
    found : iterable of Template
        The library's templates.
    seed : int, default=0
        Seed of the learner.
    """
    value = evidence.value
    if len(value) < 20:
        return Floor(0.0, value)
    folds = _folds(evidence)
    single = value - _best_effect(evidence, found, folds)
    choices = [value - np.mean(value), single]
    if len(value) >= LEAST:
        X = _features(evidence)
        choices += [r - _forest(X, r, folds, seed) for r in (value, single)]
    left = min(choices, key=lambda r: float(np.mean(np.square(r))))
    return Floor(float(np.sqrt(np.mean(np.square(left)))), left)


def sense_of(evidence: SignalEvidence, found: Sequence[Template]) -> int:
    """Return 1 where effects take away from the target, as friction does from what an actuator delivers, else −1.

    It is −1 where the target is what moves the thing: friction then adds to it. Amplitudes have signs, so only one of
    both fits.
    """
    best = {}
    for sense in (1, -1):
        gains = [
            _explained(
                sense * evidence.value, t.columns * evidence.noise[:, None], t, np.ones(len(evidence.value), bool)
            )
            for t in found
        ]
        best[sense] = max(
            (1.0 - np.mean(np.square(sense * evidence.value - g)) / np.mean(np.square(evidence.value)) for g in gains),
            default=0.0,
        )
    return -1 if best[-1] > best[1] + _CLEARLY else 1


def _folds(evidence: SignalEvidence) -> np.ndarray:
    runs = np.unique(evidence.run)
    if len(runs) >= 3:
        return evidence.run % FOLDS if len(runs) > FOLDS else evidence.run
    return (2 * FOLDS * np.arange(len(evidence.run))) // max(len(evidence.run), 1) % FOLDS


def _explained(value: np.ndarray, columns: np.ndarray, t: Template, rows: np.ndarray) -> np.ndarray:
    """Return what a template predicts of a residual when fitted on some rows; a template holds minus what it adds."""
    A = -columns[rows]
    return -columns @ bounded(A.T @ A, A.T @ value[rows], t.lower, t.upper)


def _best_effect(evidence: SignalEvidence, found: Iterable[Template], folds: np.ndarray) -> np.ndarray:
    best, least = np.zeros(len(evidence.value)), np.inf
    for t in found:
        columns, predicted = t.columns * evidence.noise[:, None], np.zeros(len(evidence.value))
        for k in np.unique(folds):
            test = folds == k
            predicted[test] = _explained(evidence.value, columns, t, ~test)[test]
        left = float(np.mean(np.square(evidence.value - predicted)))
        if left < least:
            best, least = predicted, left
    return best


def _features(evidence: SignalEvidence) -> np.ndarray:
    """Return signals, their past, and the path since the last reversal, at the centre of each window."""
    centre = evidence.first + evidence.n // 2
    start = evidence.borders[evidence.run]
    columns = []
    for role, x in evidence.table.items():
        if role == "time":
            continue
        columns.append(x[centre])
        columns += [x[np.maximum(centre - max(1, round(lag / evidence.dt)), start)] for lag in LAGS]
    if "position" in evidence.table:
        since = np.empty(len(evidence.path))
        ends = [*evidence.borders[1:].tolist(), len(since)]
        for a, b in zip(evidence.borders.tolist(), ends, strict=True):
            x = evidence.path[a:b]
            turns = reversals(x)
            last = np.maximum(np.searchsorted(turns, np.arange(b - a), side="left") - 1, 0)
            since[a:b] = x - x[turns[last]]
        columns.append(since[centre])
    columns.append((centre - start) * evidence.dt)
    return np.column_stack(columns)


def _forest(X: np.ndarray, y: np.ndarray, folds: np.ndarray, seed: int) -> np.ndarray:
    from sklearn.ensemble import HistGradientBoostingRegressor

    out = np.zeros(len(y))
    step = max(1, len(y) // _ROWS)
    leaf = int(np.clip(len(y) // 100, 5, 30))
    for k in np.unique(folds):
        train = np.flatnonzero(folds != k)[::step]
        learner = HistGradientBoostingRegressor(
            max_iter=60, max_leaf_nodes=15, min_samples_leaf=leaf, early_stopping=False, random_state=seed
        )
        out[folds == k] = learner.fit(X[train], y[train]).predict(X[folds == k])
    return out

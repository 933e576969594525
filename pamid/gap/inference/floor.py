"""The noise of a target, the predictable share of a residual, the sign of effects: known before any name."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from ...signals.paths import reversals
from ..residuals.ports import PortEvidence
from .sensitivity import Template
from .student_t import bounded

LAGS = (0.02, 0.1, 0.5, 2.0)
"""Ages of the past signals that the learner reads, s."""
FOLDS = 5
_ROWS = 12_000
_AT_ONCE = 64  # templates, so that they take little memory; the answer is the same for any number
_CLEARLY = 0.05  # share of the power by which the other sense must explain more


class Learnable(NamedTuple):
    """One equation of the evidence, as a learner reads it."""

    value: np.ndarray
    """Residual of each window."""
    noise: np.ndarray
    run: np.ndarray
    """Its standard deviation and run."""
    centre: np.ndarray
    """Its row."""
    table: Mapping[str, np.ndarray]
    """Signals at each row."""
    path: np.ndarray
    """The position, without reversals by noise; zero where there is none."""
    starts: np.ndarray
    """First row of each run."""
    dt: float


class Learned(NamedTuple):
    """What is left of a residual on held-out runs by the best of several learners."""

    rms: float
    """Its root mean square, in the target's unit."""
    left: np.ndarray
    """What is left at each window, shape (n_windows,)."""
    share: float
    """Share of the gap beyond the noise that could be predicted."""


LEAST_VALUES = 200
"""Windows below which a forest learns nothing that a single effect does not."""


def explainable(
    evidence: Learnable, found: Iterable[Template], noise: float, seed: int = 0, enough: float = 0.0
) -> Learned:
    """Return the residual that a flexible learner, one effect or both leave on held-out runs: the explainable part."""
    value = evidence.value
    if len(value) < 20:
        return Learned(0.0, value, 0.0)
    folds = _folds(evidence)
    single = value - _best_effect(evidence, found, folds)
    choices = [value - np.mean(value), single]
    # A forest alone may see what one beside an effect does not: a hysteresis that a lag explains by half.
    X: np.ndarray | None = None
    for rest in (single, value) if len(value) >= LEAST_VALUES else ():
        if min(float(np.mean(np.square(r))) for r in choices) <= (enough * noise) ** 2:
            break
        X = _features(evidence) if X is None else X
        choices.append(rest - _forest(X, rest, folds, seed))
    left = min(choices, key=lambda r: float(np.mean(np.square(r))))
    power, least = float(np.mean(np.square(value))), float(np.mean(np.square(left)))
    share = (power - least) / max(power - noise**2, 1e-300) if power > noise**2 else 0.0
    return Learned(float(np.sqrt(least)), left, float(np.clip(share, 0.0, 1.0)))


def sense_of(evidence: PortEvidence, found: Sequence[Template]) -> int:
    """Return 1 where effects subtract from the target, −1 where the target is the driving force and they add to it."""
    found = [t for t in found if np.all(t.lower >= 0.0)]
    found = [t for t in found if not {"measure", "adjust"} & set(evidence.effects[t.effect].hooks())]
    J, best, every = evidence.J * evidence.noise[:, None], {}, np.ones(len(evidence.value), bool)
    value, *columns = (x - J @ (np.linalg.pinv(J) @ x)  # beside what free numbers explain
                       for x in (evidence.value, *(t.columns * evidence.noise[:, None] for t in found)))  # fmt: skip
    for sense in (1, -1):
        gains = [_explained(sense * value, c, t, every) for c, t in zip(columns, found, strict=True)]
        best[sense] = max(
            (1.0 - np.mean(np.square(sense * value - g)) / np.mean(np.square(value)) for g in gains), default=0.0
        )
    return -1 if best[-1] > best[1] + _CLEARLY else 1


def _folds(evidence: Learnable) -> np.ndarray:
    runs = np.unique(evidence.run)
    if len(runs) >= 3:
        return evidence.run % FOLDS if len(runs) > FOLDS else evidence.run
    return (2 * FOLDS * np.arange(len(evidence.run))) // max(len(evidence.run), 1) % FOLDS


def _explained(value: np.ndarray, columns: np.ndarray, t: Template, rows: np.ndarray) -> np.ndarray:
    """Return a template's prediction of a residual when fitted on some rows; a template holds minus the effect."""
    A = -columns[rows]
    return -columns @ bounded(A.T @ A, A.T @ value[rows], t.lower, t.upper)


def _best_effect(evidence: Learnable, found: Iterable[Template], folds: np.ndarray) -> np.ndarray:
    """Return the held-out prediction of the effect that predicts most there."""
    some, rows = list(found), [np.flatnonzero(folds == k) for k in np.unique(folds)]
    best, least = np.zeros(len(evidence.value)), np.inf
    for size in {t.columns.shape[1]: None for t in some}:
        alike = [t for t in some if t.columns.shape[1] == size]
        for at in range(0, len(alike), _AT_ONCE):
            predicted = _held_out(evidence, alike[at : at + _AT_ONCE], rows)
            left = np.mean(np.square(evidence.value - predicted), axis=1)
            k = int(np.argmin(left))
            if left[k] < least:
                best, least = predicted[k], float(left[k])
    return best


def _held_out(evidence: Learnable, some: Sequence[Template], rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return the held-out predictions of templates with equally many columns, shape (n, n_windows)."""
    A = -np.stack([t.columns for t in some]) * evidence.noise[:, None]
    lower, upper = np.array([t.lower for t in some]), np.array([t.upper for t in some])
    inner = [np.swapaxes(A[:, r], 1, 2) @ A[:, r] for r in rows]
    along = [np.swapaxes(A[:, r], 1, 2) @ evidence.value[r] for r in rows]
    out = np.zeros(A.shape[:2])
    for k, r in enumerate(rows):
        # An effect in one fold only is exactly zero in the others: nothing is subtracted from a sum over all.
        G, b = (np.sum([v for j, v in enumerate(each) if j != k], axis=0) for each in (inner, along))
        if len(rows) == 1:
            G, b = np.zeros_like(inner[0]), np.zeros_like(along[0])
        out[:, r] = np.einsum("krm,km->kr", A[:, r], _all_bounded(G, b, lower, upper))
    return out


def _all_bounded(G: np.ndarray, b: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return the solutions of many small problems as `bounded` does."""
    size = np.sqrt(np.maximum(np.einsum("kii->ki", G), 1e-300))
    C = G / (size[:, :, None] * size[:, None, :]) + 1e-11 * np.eye(G.shape[1])
    x = np.linalg.solve(C, (b / size)[..., None])[..., 0] / size
    for k in np.flatnonzero(np.any((x < lower) | (x > upper), axis=1)) if G.shape[1] > 1 else ():
        x[k] = bounded(G[k], b[k], lower[k], upper[k])
    return np.asarray(np.clip(x, lower, upper))


def _features(evidence: Learnable) -> np.ndarray:
    """Return signals, their past, and the path since the last reversal, at the centre of each window."""
    centre, start = evidence.centre, evidence.starts[evidence.run]
    columns = []
    for role, x in evidence.table.items():
        if role == "time":
            continue
        columns.append(x[centre])
        columns += [x[np.maximum(centre - max(1, round(lag / evidence.dt)), start)] for lag in LAGS]
    if np.any(evidence.path):
        since = np.empty(len(evidence.path))
        ends = [*evidence.starts[1:].tolist(), len(since)]
        for a, b in zip(evidence.starts.tolist(), ends, strict=True):
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
    leaf, bins = int(np.clip(len(y) // 100, 5, 30)), int(np.clip(len(y) // 5, 32, 255))
    for k in np.unique(folds):
        train = np.flatnonzero(folds != k)[::step]
        learner = HistGradientBoostingRegressor(
            max_iter=60,
            max_leaf_nodes=15,
            min_samples_leaf=leaf,
            max_bins=bins,
            early_stopping=False,
            random_state=seed,
        )
        # Trees are small, so that threads would only wait for one another; limits set before the import do not hold.
        with threadpool_limits(1, user_api="openmp"):
            out[folds == k] = learner.fit(X[train], y[train]).predict(X[folds == k])
    return out

"""What a fitted hybrid model says of the rows of a validated table: state, volume, predictions."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from pamid.errors import ExtrapolationWarning
from pamid.signals.state import STATE_SIGNALS
from pamid.volume.base import VolumeJet, slope_of

from ._base import state_of

if TYPE_CHECKING:
    from ._pihm import HybridModel

CHUNK = 2048
"""Rows evaluated at a time: what a layer leaves stays in the cache, and memory stays flat however long the log."""

MARGIN = 0.1
"""Share of a signal's range by which a sample may lie outside it before it counts as outside."""

OUTSIDE = 0.01
"""Share of samples outside the range that is worth a warning."""


def jet_of(model: HybridModel, X: np.ndarray) -> VolumeJet:
    """Return the identified volume and its derivatives at the rows of a validated table."""
    volume = model.volume_
    parts = [volume.jet(state_of(model, X[i : i + CHUNK])) for i in range(0, len(X), CHUNK)]
    return VolumeJet(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def predicted(model: HybridModel, X: np.ndarray) -> np.ndarray:
    """Apply every law to the identified volume; shape (n_samples, n_laws)."""
    warn_of_extrapolation(model, X)
    volume, laws = model.volume_, model.laws()
    out = np.empty((len(X), len(laws)))
    alone = all(law.slope_alone for law in laws)
    for i in range(0, len(X), CHUNK):
        state = state_of(model, X[i : i + CHUNK])
        jet = VolumeJet(0.0, slope_of(volume, state), 0.0) if alone else volume.jet(state)
        for k, law in enumerate(laws):
            out[i : i + CHUNK, k] = law.predict(*jet, state)
    return out


def warn_of_extrapolation(model: HybridModel, X: np.ndarray) -> None:
    """Warn where a prediction is asked outside the range of the fit; a narrow margin around it is not counted."""
    seen = getattr(model, "input_range_", None)
    if seen is None:  # a model file of an earlier version
        return
    x = X[:, [model.signal_columns_[name] for name in STATE_SIGNALS]]
    margin = MARGIN * (seen[1] - seen[0])
    outside = np.abs(x - 0.5 * (seen[0] + seen[1])) > 0.5 * (seen[1] - seen[0]) + margin
    if outside.any() and np.mean(outside.any(axis=1)) > OUTSIDE:
        worst = int(np.argmax(outside.sum(axis=0)))
        warnings.warn(
            f"{outside.any(axis=1).mean():.0%} of {len(x)} samples lie outside the range of the data of the fit, "
            f"most in {STATE_SIGNALS[worst]}: {x[:, worst].min():.4g} to {x[:, worst].max():.4g}, where the fit "
            f"saw {seen[0, worst]:.4g} to {seen[1, worst]:.4g}. Expected samples like those of the fit. Fit on "
            "data that reach as far, or do not rely on these predictions.",
            ExtrapolationWarning,
            stacklevel=4,
        )


def mean_r2(y: Any, predicted: np.ndarray, sample_weight: Any = None) -> float:
    """Return R², averaged over the targets; rows where one was not measured are left out of its share."""
    from sklearn.metrics import r2_score

    Y, Z = np.asarray(y, dtype=float).reshape(len(predicted), -1), predicted.reshape(len(predicted), -1)
    w = None if sample_weight is None else np.asarray(sample_weight)
    known = [np.isfinite(Y[:, k]) for k in range(Y.shape[1])]
    scores = [
        r2_score(Y[keep, k], Z[keep, k], sample_weight=None if w is None else w[keep]) for k, keep in enumerate(known)
    ]
    return float(np.mean(scores))

"""What a fitted hybrid model says of the rows of a validated table: state, volume, predictions."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pamid.errors import ExtrapolationWarning
from pamid.signals.state import STATE_SIGNALS, State
from pamid.volume.base import VolumeJet, slope_of
from pamid.volume.neural import NeuralVolume

from ._effects import Seen, seen_by

if TYPE_CHECKING:
    from pamid.laws.base import Law

    from ._hybrid import HybridParameters

CHUNK = 2048
"""Rows evaluated at a time: what a layer leaves stays in the cache, and memory stays flat however long the log."""

MARGIN = 0.1
"""Share of a signal's range by which a sample may lie outside it before it counts as outside."""

OUTSIDE = 0.01
"""Share of samples outside the range that is worth a warning."""


def network_of(model: HybridParameters) -> NeuralVolume:
    """Return the learnt part of the volume."""
    return NeuralVolume(model.weights_, model.input_scale_, model.volume_scale_, model.activation)


def jets(model: HybridParameters, seen: Seen, alone: bool = False) -> Iterator[tuple[slice, State, VolumeJet]]:
    """Yield rows, their state and their volume (its slope in the contraction alone, if so), some rows at a time."""
    network, anchor = network_of(model), model.anchor_
    n = len(seen.inputs)
    for i in range(0, n, CHUNK):
        rows, state, x = slice(i, i + CHUNK), seen.state, seen.inputs
        if n > CHUNK:
            state, x = State(*(s[rows] for s in state)), x[rows]
        if alone:
            slope = network.slope_at_inputs(x)
            yield rows, state, VolumeJet(0.0, slope if anchor is None else slope + slope_of(anchor, state), 0.0)
            continue
        jet = network.jet_at(x)
        if anchor is not None:
            jet = VolumeJet(*(a + b for a, b in zip(anchor.jet(state), jet, strict=True)))
        yield rows, state, jet


def jet_of(model: HybridParameters, X: np.ndarray) -> VolumeJet:
    """Return the identified volume and its derivatives at the rows of a validated table."""
    parts = [jet for _, _, jet in jets(model, seen_by(model, X))]
    return VolumeJet(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def predicted(model: HybridParameters, X: np.ndarray, laws: Sequence[Law] | None = None) -> np.ndarray:
    """Apply every law, or others, to the identified volume, and add the effects; shape (n_samples, n_laws)."""
    seen, laws = seen_by(model, X), model.laws() if laws is None else laws
    # Without effects the inputs are the signals as they are, which need not be taken out of the table twice.
    x = seen.inputs if seen.added is None else X[:, [model.signal_columns_[name] for name in STATE_SIGNALS]]
    warn_outside(x, getattr(model, "input_range_", None), STATE_SIGNALS)
    out = np.zeros((len(X), len(laws))) if seen.added is None else seen.added
    for rows, state, jet in jets(model, seen, all(law.slope_alone for law in laws)):
        for k, law in enumerate(laws):
            out[rows, k] += law.predict(*jet, state)
    return out


def warn_outside(x: np.ndarray, span: np.ndarray | None, names: Sequence[str], stacklevel: int = 6) -> None:
    """Warn where samples lie outside the range of the fit; a narrow margin around it is not counted."""
    if span is None:  # a model file of an earlier version
        return
    if ((x >= span[0]) & (x <= span[1])).all():  # a sample of a control loop, as a rule
        return
    margin = MARGIN * (span[1] - span[0])
    outside = (x < span[0] - margin) | (x > span[1] + margin)
    if outside.any() and np.mean(outside.any(axis=1)) > OUTSIDE:
        worst = int(np.argmax(outside.sum(axis=0)))
        warnings.warn(
            f"{outside.any(axis=1).mean():.0%} of {len(x)} samples lie outside the range of the data of the fit, "
            f"most in {names[worst]}: {x[:, worst].min():.4g} to {x[:, worst].max():.4g}, where the fit "
            f"saw {span[0, worst]:.4g} to {span[1, worst]:.4g}. Expected samples like those of the fit. Fit on "
            "data that reach as far, or do not rely on these predictions.",
            ExtrapolationWarning,
            stacklevel=stacklevel,
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

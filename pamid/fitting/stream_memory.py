"""What an estimator remembers of a stream: rows up to a bound, lossless below it, a fair sample above it.

Below the bound a memory holds every row once, with the number of times that it came as its weight. Above the bound rows
stay with a probability in proportion to their weight, at most 1, by which their weight is divided: each part of the
stream keeps its share, however many batches came after it (E. Cohen, N. Duffield, H. Kaplan, C. Lund, M. Thorup,
"Stream sampling for variance-optimal estimation of subset sums", 2009. https://arxiv.org/abs/0803.0473). What has a
memory of its own keeps or drops whole runs.

Whether the stream has changed is nothing that a memory decides: `pamid.online.ChangeMonitor` tells it, at a stated rate
of false alarms.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Rows:
    """Rows of a stream."""

    X: np.ndarray
    """The validated table, shape (n_samples, n_columns)."""
    y: np.ndarray
    """Targets, shape (n_samples, n_targets)."""
    weight: np.ndarray
    """How often each row came, or its sample weight. Shape (n_samples,)."""
    unit: np.ndarray
    """Run of each row, or its batch. Shape (n_samples,)."""

    def __len__(self) -> int:
        return len(self.y)

    def at(self, index: np.ndarray) -> Rows:
        """Return some of the rows."""
        return Rows(*(value[index] for value in vars(self).values()))

    def followed_by(self, more: Rows) -> Rows:
        """Return these rows and others after them."""
        return Rows(*(np.concatenate(pair) for pair in zip(vars(self).values(), vars(more).values(), strict=True)))

    def plain(self) -> dict[str, Any]:
        """Return the arrays by name, as a model file holds them."""
        return dict(vars(self))


def merged(rows: Rows, *, whole: bool) -> Rows:
    """Hold what came several times once, with the sum of its weights: rows, or whole runs."""
    if whole:
        return _merged_units(rows)
    key = np.ascontiguousarray(np.column_stack([rows.X, rows.y]) + 0.0)  # no negative zero
    as_bytes = key.view(np.dtype((np.void, key.dtype.itemsize * key.shape[1]))).ravel()  # what is missing is equal, too
    _, first, inverse = np.unique(as_bytes, return_index=True, return_inverse=True)
    if len(first) == len(rows):
        return rows
    weight = np.zeros(len(rows))
    np.add.at(weight, first[inverse.ravel()], rows.weight)
    kept = np.sort(first)
    return replace(rows.at(kept), weight=weight[kept])


def _merged_units(rows: Rows) -> Rows:
    found: dict[tuple[bytes, bytes], np.ndarray] = {}
    weight, kept = rows.weight.copy(), np.ones(len(rows), dtype=bool)
    for u in np.unique(rows.unit):
        at = np.flatnonzero(rows.unit == u)
        key = (rows.X[at].tobytes(), rows.y[at].tobytes())
        if key in found:
            weight[found[key]] += rows.weight[at]
            kept[at] = False
        else:
            found[key] = at
    return replace(rows, weight=weight).at(kept)


def bounded(rows: Rows, most: int, *, whole: bool, random: np.random.Generator) -> Rows:
    """Return at most so many rows that stand for all: single ones, or whole runs."""
    if len(rows) <= most:
        return rows
    label = rows.unit if whole else np.arange(len(rows))
    names, inverse, size = np.unique(label, return_inverse=True, return_counts=True)
    chance = _chances(np.maximum(np.bincount(inverse, weights=rows.weight) / size, 1e-12), size, most)
    order = random.permutation(len(names))
    passed = np.floor(np.cumsum(chance[order]) + random.uniform())
    drawn = order[np.diff(passed, prepend=0.0) > 0.0]  # systematic sampling: chances are met exactly
    if not len(drawn):  # runs so long that one of them is too many in the mean
        drawn = random.choice(len(names), 1, p=chance / chance.sum())
    fits = np.cumsum(size[drawn]) <= most
    fits[0] = True  # of one run that is longer than the memory the end stays
    kept = np.flatnonzero(np.isin(inverse, drawn[fits]))[-most:]
    weight, total = rows.weight[kept] / chance[inverse[kept]], rows.weight.sum()
    return replace(rows.at(kept), weight=weight * (total / weight.sum()) if total else weight)


def _chances(weight: np.ndarray, size: np.ndarray, most: int) -> np.ndarray:
    """Return in proportion to weights, at most 1, how likely each unit stays, so that `most` rows stay in the mean."""
    order = np.argsort(-weight, kind="stable")
    falling, rows = weight[order], size[order]
    factor = (most - (np.cumsum(rows) - rows)) / np.cumsum((rows * falling)[::-1])[::-1]  # were those before it certain
    return np.minimum(1.0, factor[np.argmax(factor * falling <= 1.0)] * weight)

"""What an estimator remembers of a stream: rows up to a bound, lossless below it, a fair sample above it.

Below the bound a memory holds every row once, with the number of times that it came as its weight. Above the bound rows
stay with a probability in proportion to their weight and share out the weight of all (P. S. Efraimidis, P. G. Spirakis,
"Weighted random sampling with a reservoir", Information Processing Letters 97(5), 2006.
https://doi.org/10.1016/j.ipl.2005.11.003), so that the memory stands for the whole stream. What has a memory of its own
keeps or drops whole runs.

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
    weight = np.bincount(inverse, weights=rows.weight) / size
    order = np.argsort(-(random.uniform(size=len(names)) ** (1.0 / np.maximum(weight, 1e-12))), kind="stable")
    fits = np.cumsum(size[order]) <= most
    if not fits.any():  # one run is longer than the memory: its end stays
        at = np.flatnonzero(inverse == order[0])[-most:]
        return replace(rows.at(at), weight=np.full(len(at), rows.weight.sum() / len(at)))
    kept = np.zeros(len(names), dtype=bool)
    kept[order[fits]] = True
    left = rows.at(kept[inverse])
    return replace(left, weight=np.full(len(left), rows.weight.sum() / len(left)))

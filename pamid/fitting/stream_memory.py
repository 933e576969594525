"""What an estimator remembers of a stream: rows up to a bound, lossless below it, a fair sample above it.

Below the bound a memory holds every row once, with the number of times that it came as its weight. Above the bound rows
stay with a probability in proportion to their weight and share out the weight of all (P. S. Efraimidis, P. G. Spirakis,
"Weighted random sampling with a reservoir", Information Processing Letters 97(5), 2006.
https://doi.org/10.1016/j.ipl.2005.11.003), so that the memory stands for the whole stream. What has a memory of its own
keeps or drops whole trajectories.

A stream may change: the muscle is another one, or it wears. That shows where new rows lie close to remembered ones and
the target is another nevertheless. What has a memory of its own answers to the same signals by other targets anyhow, so
that there a batch is held against the model, before the model learns it. Two batches in a row that say so begin a new
regime, and what was remembered before is then weighed as what it is: evidence whose variance is larger, by as much as
it was off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

CHANGED = 4.0
"""Mean square of neighbours' differences across a change, in units of that among remembered rows: twice the error."""

OVERLAP = 0.3
"""Share of a batch that must lie close to remembered rows for a change to be told."""

APART = 20
"""Rows of a trajectory within which neighbours are one and the same event."""

ASKED = 1000
"""Rows on which a change is judged."""


@dataclass(frozen=True)
class Rows:
    """Rows of a stream.

    Parameters
    ----------
    X : ndarray, shape (n_samples, n_columns)
        The validated table.
    y : ndarray, shape (n_samples, n_targets)
        Targets.
    weight : ndarray, shape (n_samples,)
        How often each row came, or its sample weight.
    unit : ndarray of int, shape (n_samples,)
        Trajectory of each row, or its batch.
    regime : ndarray of int, shape (n_samples,)
        Number of changes before the row came.
    """

    X: np.ndarray
    y: np.ndarray
    weight: np.ndarray
    unit: np.ndarray
    regime: np.ndarray

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
    """Hold what came several times once, with the sum of its weights: rows, or whole trajectories."""
    if whole:
        return _merged_units(rows)
    key = np.column_stack([rows.X, rows.y, rows.regime])
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    if len(first) == len(rows):
        return rows
    weight = np.zeros(len(rows))
    np.add.at(weight, first[inverse.ravel()], rows.weight)
    kept = np.sort(first)
    return replace(rows.at(kept), weight=weight[kept])


def _merged_units(rows: Rows) -> Rows:
    found: dict[tuple[Any, ...], np.ndarray] = {}
    weight, kept = rows.weight.copy(), np.ones(len(rows), dtype=bool)
    for u in np.unique(rows.unit):
        at = np.flatnonzero(rows.unit == u)
        key = (rows.X[at].tobytes(), rows.y[at].tobytes(), int(rows.regime[at[0]]))
        if key in found:
            weight[found[key]] += rows.weight[at]
            kept[at] = False
        else:
            found[key] = at
    return replace(rows, weight=weight).at(kept)


def bounded(rows: Rows, most: int, *, whole: bool, random: np.random.Generator) -> Rows:
    """Return at most so many rows that stand for all: single ones, or whole trajectories."""
    if len(rows) <= most:
        return rows
    label = rows.unit if whole else np.arange(len(rows))
    names, inverse, size = np.unique(label, return_inverse=True, return_counts=True)
    weight = np.bincount(inverse, weights=rows.weight) / size
    order = np.argsort(-(random.uniform(size=len(names)) ** (1.0 / np.maximum(weight, 1e-12))), kind="stable")
    fits = np.cumsum(size[order]) <= most
    if not fits.any():  # one trajectory is longer than the memory: its end stays
        at = np.flatnonzero(inverse == order[0])[-most:]
        return replace(rows.at(at), weight=np.full(len(at), rows.weight.sum() / len(at)))
    kept = np.zeros(len(names), dtype=bool)
    kept[order[fits]] = True
    left = rows.at(kept[inverse])
    share = np.array([rows.weight[rows.regime == k].sum() / (left.regime == k).sum() for k in np.unique(left.regime)])
    return replace(left, weight=share[np.searchsorted(np.unique(left.regime), left.regime)])


def surprise(remembered: Rows, batch: Rows, columns: list[int]) -> float:
    """Say how much more a batch differs from remembered rows near it than these differ from each other.

    Differences are those of what a quadratic surface over the remembered rows leaves, so that a trend from neighbour to
    neighbour is no difference; a fitted model would not do, as it may know its own rows by heart.

    Parameters
    ----------
    remembered, batch : Rows
        Rows of the present regime, and new ones.
    columns : list of int
        Columns of X that are signals.

    Returns
    -------
    float
        Ratio of the mean squared differences between neighbours, largest over the targets; 1 where the two hardly
        overlap, or where there are too few rows to tell.
    """
    if len(remembered) < 2 * APART:
        return 1.0
    x, z = _scaled(remembered, batch, columns)
    error, new_error = _off_the_surface(x, remembered.y, z, batch.y)
    found = _neighbours(remembered, x, z)
    if found.overlapping.mean() < OVERLAP:
        return 1.0
    across = mean_square((new_error[found.asked] - error[found.near])[found.overlapping])
    within = mean_square(error[found.own] - error[found.other])
    told = np.isfinite(across) & np.isfinite(within) & (within > 1e-24 * mean_square(remembered.y))
    return float((across[told] / within[told]).max(initial=1.0))


def overlap(remembered: Rows, batch: Rows, columns: list[int]) -> bool:
    """Say whether enough of a batch lies close to remembered rows for a change to be told."""
    if len(remembered) < 2 * APART:
        return False
    return bool(_neighbours(remembered, *_scaled(remembered, batch, columns)).overlapping.mean() >= OVERLAP)


def unforeseen(errors: np.ndarray, error: np.ndarray) -> float:
    """Say how much larger a model's error on a batch is than on batches before, each before the model learnt it.

    Parameters
    ----------
    errors : ndarray, shape (n_batches, n_targets)
        Mean squared errors on the batches before.
    error : ndarray, shape (n_targets,)
        That on the batch.

    Returns
    -------
    float
        Ratio to their median, largest over the targets; 1 where one of them was as large, or where they are fewer than
        three.
    """
    if len(errors) < 3:
        return 1.0
    usual = np.maximum(np.median(errors, axis=0), 1e-300)
    return float(np.where(error > errors.max(axis=0), error / usual, 1.0).max(initial=1.0))


class _Neighbours(NamedTuple):
    """Rows of a batch that are asked, the remembered row nearest to each, and remembered rows nearest to each other."""

    asked: np.ndarray
    near: np.ndarray
    overlapping: np.ndarray
    own: np.ndarray
    other: np.ndarray


def _scaled(remembered: Rows, batch: Rows, columns: list[int]) -> tuple[np.ndarray, np.ndarray]:
    low, high = remembered.X[:, columns].min(axis=0), remembered.X[:, columns].max(axis=0)
    width = np.where(high > low, high - low, 1.0)
    return (remembered.X[:, columns] - low) / width, (batch.X[:, columns] - low) / width


def _neighbours(remembered: Rows, x: np.ndarray, z: np.ndarray) -> _Neighbours:
    """Find neighbours; those of the same trajectory at nearly the same time are no neighbours."""
    from sklearn.neighbors import KDTree

    tree = KDTree(x)
    asked, own = (np.unique(np.linspace(0, len(a) - 1, min(ASKED, len(a))).astype(int)) for a in (z, x))
    far, near = tree.query(z[asked], k=1)
    close, beside = tree.query(x[own], k=min(2 * APART + 2, len(x)))
    same = (remembered.unit[beside] == remembered.unit[own][:, None]) & (np.abs(beside - own[:, None]) < APART)
    usable = ~same.all(axis=1)
    pick, rows = np.argmin(same, axis=1), np.arange(len(own))
    distance, other = close[rows, pick][usable], beside[rows, pick][usable]
    overlapping = far[:, 0] <= (np.quantile(distance, 0.9) if len(distance) else -1.0)
    return _Neighbours(asked, near[:, 0], overlapping, own[usable], other)


def _off_the_surface(x: np.ndarray, y: np.ndarray, z: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what a surface through rows (x, y) leaves of them and of others: quadratic, or less where rows are few."""

    def terms(a: np.ndarray) -> np.ndarray:
        i, j = np.triu_indices(a.shape[1])
        return np.column_stack([np.ones(len(a)), a, a[:, i] * a[:, j]])

    n, here, there = x.shape[1], terms(x), terms(z)
    width = next((k for k in (here.shape[1], n + 1) if len(x) >= 10 * k), 1)
    left, left_there = np.empty_like(y), np.empty_like(w)
    for k in range(y.shape[1]):
        known = np.isfinite(y[:, k])
        solution = np.linalg.lstsq(here[known, :width], y[known, k], rcond=1e-10)[0]
        left[:, k] = y[:, k] - here[:, :width] @ solution
        left_there[:, k] = w[:, k] - there[:, :width] @ solution
    return left, left_there


def mean_square(columns: np.ndarray) -> np.ndarray:
    """Return the mean square of each column over its finite values."""
    known = np.isfinite(columns)
    return (np.where(known, columns, 0.0) ** 2).sum(axis=0) / np.maximum(known.sum(axis=0), 1)

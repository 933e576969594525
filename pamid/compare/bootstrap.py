"""Intervals of a root mean square error when runs, not rows, are what would be drawn again."""

from typing import NamedTuple

import numpy as np


class Interval(NamedTuple):
    """A value with the interval that its bootstrap gives."""

    value: float
    low: float
    high: float
    """In the unit of the value."""


class ClusterBootstrap:
    """Bootstrap draws of whole runs, with replacement, shared by all comparisons; too narrow below about ten runs."""

    def __init__(self, clusters: np.ndarray, n_draws: int = 2000, level: float = 0.9, random_state: int = 0) -> None:
        self.clusters = np.asarray(clusters)
        self.n_clusters = int(self.clusters.max()) + 1
        self.quantiles = ((1 - level) / 2, (1 + level) / 2)
        rng = np.random.default_rng(random_state)
        self._times = rng.multinomial(self.n_clusters, np.full(self.n_clusters, 1 / self.n_clusters), size=n_draws)
        self._rows = self._times @ np.bincount(self.clusters)

    def draws(self, squared_error: np.ndarray) -> np.ndarray:
        """Return the root mean square error of each draw."""
        sums = np.bincount(self.clusters, weights=squared_error, minlength=self.n_clusters)
        return np.sqrt(self._times @ sums / self._rows)

    def rmse(self, squared_error: np.ndarray) -> Interval:
        """Return the root mean square error with its interval."""
        low, high = np.quantile(self.draws(squared_error), self.quantiles)
        return Interval(float(np.sqrt(np.mean(squared_error))), float(low), float(high))

    def difference(self, squared_error: np.ndarray, other: np.ndarray) -> Interval:
        """Return the difference of two RMS errors on the same rows and draws, with its interval."""
        low, high = np.quantile(self.draws(squared_error) - self.draws(other), self.quantiles)
        value = np.sqrt(np.mean(squared_error)) - np.sqrt(np.mean(other))
        return Interval(float(value), float(low), float(high))

"""A force balance that is linear in its parameters: what drives a cylinder or a joint, friction included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ._base import SignalRegressor
from ._checks import check_sizes
from ._linear import LinearTerms
from ._trajectories import trajectory_codes


class BalanceRegressor(LinearTerms, SignalRegressor):
    """Shared by `CylinderForce` and `JointDrive`: a sum of terms of named signals, each term a physical parameter."""

    _state: ClassVar[Any]
    """Tuple of the signals, in the order of `reads`."""
    still: float

    def _output(self) -> tuple[str, str]:
        """Return name and unit of what is predicted."""
        raise NotImplementedError

    def _way(self, speed: Any) -> Any:
        """Return the sign of the motion, smooth about standstill."""
        return np.tanh(speed / self.still)

    def _training(
        self, X: Any, y: Any, sample_weight: Any, groups: Any, *, reset: bool = True, least: int = 2
    ) -> tuple[NamedTuple, np.ndarray, np.ndarray, np.ndarray | None]:
        check_sizes(self, still=1e-12)
        clusters = None if groups is None else trajectory_codes(X, groups)
        X, y, weight = self._read_weighted(X, y, sample_weight, reset=reset, ensure_min_samples=least)
        return self._signals_of(X), y, weight, clusters

    def _signals_of(self, X: np.ndarray) -> Any:
        return self._state(*(self._signal(X, name) for name in self.reads))

    def predict(self, X: Any) -> np.ndarray:
        """Predict the force, N, or the drive, in its unit."""
        return self._predict_state(self._signals_of(self._read_fitted(X, "coef_")))

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the prediction as a formula of the signals, which may be symbols: what an export writes."""
        name, unit = self._output()
        return {name: (unit, self._formula(self._state(*(signals[s] for s in self.reads))))}

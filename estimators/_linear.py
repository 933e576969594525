"""Fits that are linear in their coefficients, at once or in batches: sums of terms, laws over a polynomial volume."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from pamid.errors import ParameterError
from pamid.fitting.least_squares import cluster_covariance, compress, solve
from pamid.signals.state import State
from pamid.volume import VolumeJet

from ._base import SignalRegressor
from ._checks import check_sizes
from ._classical import ClassicalRegressor, warn_of_still_signals
from ._trajectories import trajectory_codes

CHUNK = 65_536
"""Rows compressed at a time: memory stays flat however long the log."""


class LinearTerms:
    """A prediction that is a sum of terms, each a coefficient times what signals give.

    A subclass says how the signals are read and what stands behind each coefficient.

    Attributes
    ----------
    coef_ : ndarray, shape (n_coefficients,)
        The coefficients, SI units.
    parameters_ : dict of str to float
        The coefficients by name.
    standard_errors_ : dict of str to float
        Their standard errors, infinite where the data do not determine them; with `groups`, cluster-robust.
    units_ : dict of str to str
        Their units.
    covariance_ : ndarray, shape (n_coefficients, n_coefficients)
        Their covariance.
    factor_ : ndarray
        Triangular factor of all rows seen, from which `partial_fit` continues.
    total_weight_ : float
        Sum of the weights of all rows seen.
    """

    coef_: np.ndarray

    # --- what a subclass gives --------------------------------------------------------------------------------
    _training: Any
    """Method that validates what a fit is given: a tuple of signals, target, weights, clusters."""
    reads: ClassVar[Any]
    """Names of the signals that it reads."""

    def _terms(self) -> dict[str, str]:
        """Return the name and unit of each coefficient."""
        raise NotImplementedError

    def _shares(self, state: Any) -> list[Any]:
        """Return the regressors of the coefficients."""
        raise NotImplementedError

    def _columns(self, state: Any) -> np.ndarray:
        """Return the same as columns, shape (n_samples, n_coefficients)."""
        return np.column_stack(self._shares(state))

    # --- the fit ----------------------------------------------------------------------------------------------
    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Fit the coefficients by linear least squares.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Run of each row. It does not change the fit, only its standard errors: residuals of one
            run are then taken as dependent.
        """
        state, y, weight, clusters = self._training(X, y, sample_weight, groups)
        warn_of_still_signals(state, self.reads, type(self).__name__)
        self._start_over()
        self._take_in(state, y, weight)
        if clusters is not None:
            A = self._columns(state)
            self.covariance_ = cluster_covariance(A, y - A @ self.coef_, weight, clusters)
            self._name_results()
        return self

    def partial_fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Take in further rows: after any number of batches the fit is that of all their rows at once.

        The rows are compressed into a triangular factor of fixed size, so memory does not grow. The coefficients
        equal those of one `fit` on all rows up to rounding; so do the standard errors, which here are never
        cluster-robust.

        Parameters
        ----------
        groups : array_like, shape (n_samples,), optional
            Accepted for the sake of pipelines; it changes nothing here.
        """
        first = not hasattr(self, "factor_")
        state, y, weight, _ = self._training(X, y, sample_weight, groups, reset=first, least=1)
        if first:
            self._start_over()
        self._take_in(state, y, weight)
        return self

    def _start_over(self) -> None:
        self.factor_ = np.zeros((0, len(self._terms()) + 1))
        self.total_weight_ = 0.0

    def _take_in(self, state: Any, y: np.ndarray, weight: np.ndarray) -> None:
        for begin in range(0, len(y), CHUNK):
            rows = slice(begin, begin + CHUNK)
            A = self._columns(type(state)(*(s[rows] for s in state)))
            self.factor_ = compress(self.factor_, A, y[rows], weight[rows])
        self.total_weight_ += float(weight.sum())
        solution = solve(self.factor_, self.total_weight_)
        self.coef_, self.covariance_ = solution.x, solution.covariance
        self._name_results()

    def _name_results(self) -> None:
        self.units_ = self._terms()
        self.parameters_ = dict(zip(self.units_, self.coef_.tolist(), strict=True))
        errors = np.sqrt(np.maximum(np.diag(self.covariance_), 0.0))
        self.standard_errors_ = dict(zip(self.units_, errors.tolist(), strict=True))

    def _predict_state(self, state: Any) -> np.ndarray:
        return self._columns(state) @ self.coef_

    def _formula(self, state: Any) -> Any:
        return sum(c * share for c, share in zip(self.coef_.tolist(), self._shares(state), strict=True))


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


class PolynomialRegressor(LinearTerms, ClassicalRegressor):
    """Shared by `PolynomialForce` and `PolynomialFlow`."""

    def _basis(self, state: State) -> list[VolumeJet]:
        """Return the volume, with its derivatives, that each coefficient multiplies."""
        raise NotImplementedError

    def _shares(self, state: State) -> list[Any]:
        """Return the regressors of the coefficients."""
        (law,) = self.laws()
        return [law.predict(*jet, state) for jet in self._basis(state)]

    def _jet(self, state: State) -> VolumeJet:
        basis = self._basis(state)
        jet = VolumeJet(*(sum(c * b[i] for c, b in zip(self.coef_, basis, strict=True)) for i in range(3)))
        return jet._replace(V=jet.V + self._level())

    def _level(self) -> float:
        """Return a volume, m³, that the fit cannot see and the user states."""
        return 0.0


def require_degree(name: str, value: Any, least: int) -> int:
    """Return a polynomial degree as an int, or raise."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= 12:
        remedy = f"Pass form={value!r}." if isinstance(value, str) else "Correct the degree."
        raise ParameterError(f"{name} is {value!r}.", f"an integer from {least} to 12", remedy)
    return int(value)

"""A law over a volume that is linear in its coefficients: linear least squares, in one go or in batches."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted

from pamid.errors import ParameterError
from pamid.fitting.least_squares import cluster_covariance, compress, solve
from pamid.signals.state import State
from pamid.volume import VolumeJet, check_volume

from ._classical import ClassicalRegressor, warn_of_still_signals

CHUNK = 65_536
"""Rows compressed at a time: memory stays flat however long the log."""


class PolynomialRegressor(ClassicalRegressor):
    """Shared by `PolynomialForce` and `PolynomialFlow`."""

    __metadata_request__partial_fit = {"groups": True}  # noqa: RUF012 - scikit-learn reads it by this name

    # --- what a subclass gives --------------------------------------------------------------------------------
    def _terms(self) -> dict[str, str]:
        """Return the name and unit of each coefficient."""
        raise NotImplementedError

    def _basis(self, state: State) -> list[VolumeJet]:
        """Return the volume, with its derivatives, that each coefficient multiplies."""
        raise NotImplementedError

    def _shares(self, state: State) -> list[Any]:
        """Return what each coefficient multiplies in the prediction."""
        law = self._law()
        return [law.predict(*jet, state) for jet in self._basis(state)]

    def _columns(self, state: State) -> np.ndarray:
        """Return the same as columns, shape (n_samples, n_coefficients)."""
        return np.column_stack(self._shares(state))

    # --- the fit ----------------------------------------------------------------------------------------------
    def fit(self, X: Any, y: Any, sample_weight: Any = None, groups: Any = None) -> Self:
        """Fit the coefficients by linear least squares.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            The signals, SI units, absolute pressure.
        y : array_like, shape (n_samples,)
            What the law predicts: tension in N or mass flow in kg/s.
        sample_weight : array_like, shape (n_samples,), optional
            Weights; a weight of 2 is the same row twice.
        groups : array_like, shape (n_samples,), optional
            Trajectory of each row. It does not change the fit, only its standard errors: residuals of one
            trajectory are then taken as dependent.

        Returns
        -------
        self
            The fitted estimator.
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
        X : DataFrame or array, shape (n_samples, n_columns)
            The signals, SI units, absolute pressure.
        y : array_like, shape (n_samples,)
            What the law predicts: tension in N or mass flow in kg/s.
        sample_weight : array_like, shape (n_samples,), optional
            Weights; a weight of 2 is the same row twice.
        groups : array_like, shape (n_samples,), optional
            Accepted for the sake of pipelines; it changes nothing here.

        Returns
        -------
        self
            The fitted estimator.
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

    def _take_in(self, state: State, y: np.ndarray, weight: np.ndarray) -> None:
        for begin in range(0, len(y), CHUNK):
            rows = slice(begin, begin + CHUNK)
            A = self._columns(State(*(s[rows] for s in state)))
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

    def _predict_state(self, state: State) -> np.ndarray:
        return self._columns(state) @ self.coef_

    def _formula(self, state: State) -> Any:
        return sum(c * share for c, share in zip(self.coef_.tolist(), self._shares(state), strict=True))

    def volume(self, X: Any) -> VolumeJet:
        """Return the identified volume and its derivatives, and warn where they make no physical sense.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            The signals that the fit read, SI units, absolute pressure.

        Returns
        -------
        VolumeJet
            V (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa), each of shape (n_samples,).

        Warns
        -----
        VolumeWarning
            If the volume is not positive or falls with contraction.
        """
        check_is_fitted(self)
        X, _ = self._read(X, reset=False)
        state = self._state(X)
        basis = self._basis(state)
        jet = VolumeJet(*(sum(c * b[i] for c, b in zip(self.coef_, basis, strict=True)) for i in range(3)))
        jet = jet._replace(V=jet.V + self._level())
        check_volume(jet, state, level_known=self._level_known)
        return jet

    def _level(self) -> float:
        """Return a volume, m³, that the fit cannot see and the user states."""
        return 0.0


def require_degree(name: str, value: Any, least: int) -> int:
    """Return a polynomial degree as an int, or raise."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= 12:
        remedy = f"Pass form={value!r}." if isinstance(value, str) else "Correct the degree."
        raise ParameterError(f"{name} is {value!r}.", f"an integer from {least} to 12", remedy)
    return int(value)

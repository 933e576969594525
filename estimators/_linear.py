"""A fit that is linear in its coefficients: least squares in one go or in batches, with standard errors."""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np

from pamid.fitting.least_squares import cluster_covariance, compress, solve

from ._classical import warn_of_still_signals

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

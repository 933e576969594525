"""Force bilinear in contraction and pressure. Copy to ``estimators/my_estimator.py``, change signals, fit, predict."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted, column_or_1d

from ._base import SignalRegressor
from ._parameters import parameters


@parameters
class MyEstimator(SignalRegressor):
    r"""Force that is bilinear in contraction and pressure, :math:`F = a + b\,P + c\,\varepsilon + d\,P\,\varepsilon`.

    Annotated fields are the parameters of the constructor; bases explain those that they declare, such as `signals`.

    Attributes
    ----------
    coefficients_ : ndarray, shape (4,)
        a (N), b (N/Pa), c (N), d (N/Pa).
    """

    reads = ("eps", "P")
    equations = ("force",)

    def fit(self, X: Any, y: Any) -> Self:
        """Fit by least squares.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            ``eps`` (dimensionless), ``P`` (Pa, absolute).
        y : array_like, shape (n_samples,)
            Force, N.
        """
        table, y = self._read(X, y, reset=True)
        columns = self._columns(table)
        scale = np.maximum(np.max(np.abs(columns), axis=0), 1e-300)
        self.coefficients_ = np.linalg.lstsq(columns / scale, column_or_1d(y, warn=True), rcond=None)[0] / scale
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Return the force.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            As in fit.

        Returns
        -------
        ndarray, shape (n_samples,)
            Force, N.
        """
        check_is_fitted(self)
        table, _ = self._read(X, reset=False)
        return np.asarray(self._columns(table) @ self.coefficients_)

    def _columns(self, table: np.ndarray) -> np.ndarray:
        eps, P = (self._signal(table, name) for name in self.reads)
        return np.column_stack([np.ones(len(table)), P, eps, P * eps])

    @staticmethod
    def _checked_instances() -> list[MyEstimator]:
        return [MyEstimator(signals={"eps": 0, "P": 0})]  # one column for both: the checks bring any X

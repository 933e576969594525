"""Sparse regression of a force or a flow on a library of terms, by PySINDy."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Any, ClassVar, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted

from ._base import SignalRegressor
from ._checks import warn_of_still_columns
from ._parameters import parameters
from ._sparse_polynomial import PolynomialLibraryMixin


@parameters
class SINDyRegressor(PolynomialLibraryMixin, SignalRegressor):
    r"""Force or mass flow as a sparse polynomial of the muscle's signals.

    .. math:: y = \sum_k \xi_k\, \theta_k(\varepsilon, \dot\varepsilon, P, \dot P, \ldots), \quad \xi \text{ sparse}

    with monomials :math:`\theta_k` of the signals, and of the signs of some of them. The sparse coefficients
    :math:`\xi` come from PySINDy. A static model: rows are independent, and time order plays no part.

    Parameters
    ----------
    inputs : sequence of str, default=("eps", "deps", "P", "dP")
        Signals that the polynomial reads: contraction ratio (dimensionless), its rate (1/s), absolute pressure (Pa)
        and its rate (Pa/s). Any names of columns will do.
    target : str, default="y"
        Name of the target in `equations_`, for instance ``"F"`` or ``"mdot"``.

    Attributes
    ----------
    coef_ : ndarray, shape (n_terms,)
        Coefficient of each term, in units of the target over units of the term (N/Pa for a term P of a force).
    coefficients_ : dict of str to float
        The terms that were kept, and their coefficients.
    equations_ : list of str
        The polynomial, written out.

    See Also
    --------
    SINDyModel : Learns rates of change from runs, and simulates.

    Notes
    -----
    Sample weights are equivalent to repeated rows: `sample_weight` scales the rows of the regression by its root, and
    all scales are weighted.

    References
    ----------
    S. L. Brunton, J. L. Proctor, J. N. Kutz, "Discovering governing equations from data by sparse identification of
    nonlinear dynamical systems", PNAS 113(15), 2016. https://doi.org/10.1073/pnas.1517384113

    P. Zheng et al., "A unified framework for sparse relaxed regularized regression: SR3", IEEE Access 7, 2019.
    https://doi.org/10.1109/ACCESS.2018.2886528

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import SINDyRegressor
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.25, 300), "P": rng.uniform(1e5, 7e5, 300)})
    >>> force = 2e-3 * X["P"] - 0.03 * X["eps"] ** 2 * X["P"] - 200.0
    >>> model = SINDyRegressor(inputs=("eps", "P"), target="F").fit(X, force)
    >>> model.equations_
    ['F = -200 + 0.002 P - 0.03 eps^2 P']
    """

    inputs: Sequence[str] = ("eps", "deps", "P", "dP")
    _: KW_ONLY
    target: str = "y"

    equations = ("force", "flow")
    _settings: ClassVar = {"": {}, "with signs": {"sign_of": ("deps", "dP")}}
    _checked = (
        {"degree": 1},
        {"inputs": ("x",), "degree": 3, "sign_of": ("x",), "optimizer": "sr3", "alpha": 0.0},
        {"inputs": ("x",), "degree": 3, "optimizer": "frols", "max_iter": 3},
    )

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return tuple(self.inputs)

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Find the sparse polynomial."""
        columns, target, weights = self._rows(X, y, sample_weight, reset=True, ensure_min_samples=2)
        warn_of_still_columns(columns, self.inputs, type(self).__name__)
        self._fit_library(columns, self.inputs, target, weights)
        return self._named()

    def partial_fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Take in further rows: after any number of batches the polynomial is that of one `fit` on all of them.

        The rows are compressed into a triangular factor of fixed size, which gives the sparse regression the same
        information as the rows; an optimizer of PySINDy that draws among rows draws among those of the factor, in `fit`
        too.
        """
        if not hasattr(self, "factor_"):
            return self.fit(X, y, sample_weight)
        self._take_in(*self._rows(X, y, sample_weight, reset=False))
        return self._named()

    def _rows(self, X: Any, y: Any, sample_weight: Any, **how: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        table, target, weights = self._read_weighted(X, y, sample_weight, **how)
        self._check_library(self.inputs)
        return self._signals(table, self.inputs), target[:, None], weights

    def _named(self) -> Self:
        """Set what the coefficients are called."""
        self.coef_ = self._physical_coefficients()[0]
        self.coefficients_ = {t: float(c) for t, c in zip(self.terms_, self.coef_, strict=True) if c != 0}
        self.equations_ = self._equations([self.target])
        return self

    def predict(self, X: Any) -> np.ndarray:
        """Evaluate the polynomial."""
        return self._evaluate(self._signals(self._read_fitted(X, "coef_"), self.inputs))[:, 0]

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the predictions as formulas of the signals, which may be symbols: what an export writes."""
        turned = [signals[n] for n in self.sign_of]
        factors = [signals[n] for n in self.inputs]
        factors += [np.where(s > 0.0, 1.0, np.where(s < 0.0, -1.0, 0.0)) for s in turned]
        total: Any = 0.0
        for c, powers in zip(self.coef_.tolist(), self.powers_.astype(int).tolist(), strict=True):
            if c != 0.0:
                total = total + math.prod((f**p for f, p in zip(factors, powers, strict=True) if p), start=c)
        return {str(self.target): ("unit of the fit", total)}

    @property
    def n_parameters_(self) -> int:
        """Number of terms that are kept."""
        check_is_fitted(self, "coefficients_")
        return len(self.coefficients_)

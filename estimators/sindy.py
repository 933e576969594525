"""Sparse regression of a force or a flow on a library of terms, by PySINDy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from sklearn.base import RegressorMixin
from sklearn.utils.validation import check_is_fitted

from ._base import SignalEstimator, Signals
from ._checks import warn_of_still_columns
from ._sparse_polynomial import PolynomialLibraryMixin


class SINDyRegressor(PolynomialLibraryMixin, RegressorMixin, SignalEstimator):
    r"""Force or mass flow as a sparse polynomial of the muscle's signals.

    .. math:: y = \sum_k \xi_k\, \theta_k(\varepsilon, \dot\varepsilon, P, \dot P, \ldots), \quad \xi \text{ sparse}

    with monomials :math:`\theta_k` of the signals, and of the signs of some of them. The sparse coefficients
    :math:`\xi` come from PySINDy. A static model: rows are independent, and time order plays no part.

    Parameters
    ----------
    inputs : sequence of str, default=("eps", "deps", "P", "dP")
        Signals that the polynomial reads: contraction ratio (dimensionless), its rate (1/s), absolute pressure (Pa)
        and its rate (Pa/s). Any names of columns will do.
    degree : int, default=3
        Highest degree of a term.
    interaction : bool, default=True
        Whether terms mix signals.
    bias : bool, default=True
        Whether there is a constant term.
    sign_of : sequence of str, default=()
        Signals whose sign enters the library too, for effects of the direction of motion (``("deps",)``).
    optimizer : {"stlsq", "sr3", "frols"} or PySINDy optimizer, default="stlsq"
        Sparse regression: sequentially thresholded least squares, sparse relaxed regularised regression, or greedy
        orthogonal selection. An instance of PySINDy is cloned, and brings its own settings.
    threshold : float, default=0.02
        Terms whose coefficient is smaller are dropped; in units of the target's root mean square for a term scaled
        to root mean square one (dimensionless). No effect for "frols".
    alpha : float, default=1e-6
        Ridge penalty in the scaled problem, dimensionless; no effect for "sr3".
    max_iter : int, default=20
        Maximum number of iterations; for "frols", of terms.
    target : str, default="y"
        Name of the target in `equations_`, for instance ``"F"`` or ``"mdot"``.
    signals : mapping of str to str or int, optional
        Column of a signal, by name or position, where it is not the signal's own name or place.

    Attributes
    ----------
    coef_ : ndarray, shape (n_terms,)
        Coefficient of each term, in units of the target over units of the term (N/Pa for a term P of a force).
    coefficients_ : dict of str to float
        The terms that were kept, and their coefficients.
    terms_ : list of str
        All terms of the library.
    equations_ : list of str
        The polynomial, written out.
    powers_ : ndarray, shape (n_terms, n_signals + n_signs)
        Exponent of each signal, and of each sign, in each term.
    signal_scales_ : ndarray, shape (n_signals,)
        Root mean square of each signal, in the signal's unit.
    scaled_coef_ : ndarray, shape (1, n_terms)
        Coefficients for signals in units of `signal_scales_`.
    n_iter_ : int
        Iterations of the sparse regression.
    factor_ : ndarray
        Triangular factor of terms and target over all rows seen, from which `partial_fit` continues.
    total_weight_ : float
        Sum of the weights of all rows seen.
    reference_scales_ : ndarray, shape (n_signals,)
        Scales of the signals in `factor_`.
    signal_columns_ : dict of str to int
        Column of each signal.
    n_features_in_ : int
        Number of columns seen in fit.
    feature_names_in_ : ndarray of str
        Names of these columns, if they have names.

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

    equations = ("force", "flow")

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {"": {}, "with signs": {"sign_of": ("deps", "dP")}}

    def __init__(
        self,
        inputs: Sequence[str] = ("eps", "deps", "P", "dP"),
        *,
        degree: int = 3,
        interaction: bool = True,
        bias: bool = True,
        sign_of: Sequence[str] = (),
        optimizer: Any = "stlsq",
        threshold: float = 0.02,
        alpha: float = 1e-6,
        max_iter: int = 20,
        target: str = "y",
        signals: Signals | None = None,
    ) -> None:
        self.inputs = inputs
        self.degree = degree
        self.interaction = interaction
        self.bias = bias
        self.sign_of = sign_of
        self.optimizer = optimizer
        self.threshold = threshold
        self.alpha = alpha
        self.max_iter = max_iter
        self.target = target
        self.signals = signals

    @property
    def reads(self) -> tuple[str, ...]:  # type: ignore[override]  # noqa: D102
        return tuple(self.inputs)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True  # reads signals of meaning, not whatever column is informative
        return tags

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Find the sparse polynomial.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units.
        y : array_like, shape (n_samples,)
            Force (N), mass flow (kg/s) or any other target.
        sample_weight : array_like, shape (n_samples,), optional
            Weight of each row.

        Returns
        -------
        SINDyRegressor
            The fitted estimator itself.
        """
        columns, target, weights = self._rows(X, y, sample_weight, reset=True, ensure_min_samples=2)
        warn_of_still_columns(columns, self.inputs, type(self).__name__)
        self._fit_library(columns, self.inputs, target, weights)
        return self._named()

    def partial_fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Take in further rows: after any number of batches the polynomial is that of one `fit` on all of them.

        The rows are compressed into a triangular factor of fixed size, which gives the sparse regression the same
        information as the rows; an optimizer of PySINDy that draws among rows draws among those of the factor, in `fit`
        too.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units.
        y : array_like, shape (n_samples,)
            Target, as in `fit`.
        sample_weight : array_like, shape (n_samples,), optional
            Weight of each row.

        Returns
        -------
        SINDyRegressor
            The fitted estimator itself.
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
        """Evaluate the polynomial.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units.

        Returns
        -------
        ndarray, shape (n_samples,)
            Prediction in the unit of y.
        """
        check_is_fitted(self)
        X, _ = self._read(X, reset=False)
        return self._evaluate(self._signals(X, self.inputs))[:, 0]

    def formulas(self, signals: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
        """Return the predictions as formulas of the signals, which may be symbols: what an export writes.

        Parameters
        ----------
        signals : mapping of str to array or symbol
            Each signal that the model reads, SI units.

        Returns
        -------
        dict of str to (str, array or symbol)
            Unit and value of each output.
        """
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

    @staticmethod
    def _checked_instances() -> list[SINDyRegressor]:
        return [
            SINDyRegressor(signals=dict.fromkeys(("eps", "deps", "P", "dP"), 0), degree=1),
            SINDyRegressor(("x",), signals={"x": 0}, degree=3, sign_of=("x",), optimizer="sr3", alpha=0.0),
            SINDyRegressor(("x",), signals={"x": 0}, degree=3, optimizer="frols", max_iter=3),
        ]

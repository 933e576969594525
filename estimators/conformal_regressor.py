"""Intervals that hold on a new run: conformal prediction over whole runs."""

import warnings
from dataclasses import KW_ONLY
from typing import Any, NamedTuple, Self

import numpy as np
from sklearn.base import clone
from sklearn.model_selection import GroupKFold
from sklearn.utils import get_tags
from sklearn.utils.validation import _num_samples, check_consistent_length, check_is_fitted, column_or_1d, validate_data

from pamid.errors import ExcitationWarning, MissingTrajectoryError, ParameterError

from ._base import SignalEstimator, plain_table
from ._parameters import TakesFrames, parameters
from ._streaming import SequenceStreaming, forget
from ._trajectories import encode_text_columns, trajectory_codes
from ._typed import BaseEstimator, MetaEstimatorMixin, RegressorMixin


class PredictionInterval(NamedTuple):
    """An interval at each sample.

    Parameters
    ----------
    lower, upper : ndarray, shape (n_samples,)
        Its ends, in the target's unit.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.estimators.conformal_regressor import PredictionInterval
    >>> held = PredictionInterval(np.array([9.0]), np.array([11.0]))  # N
    >>> bool(held.lower[0] <= 10.0 <= held.upper[0])
    True
    """

    lower: np.ndarray
    upper: np.ndarray


@parameters
class ConformalRegressor(TakesFrames, SequenceStreaming, MetaEstimatorMixin, RegressorMixin, BaseEstimator):
    r"""Wrap a regressor to predict with intervals that are valid on unseen runs.

    Every run is predicted by a fit on others. A run of :math:`n_k` samples weighs each of its errors with
    :math:`1/((K+1)\,n_k)`, the new one weighs :math:`1/(K+1)` at infinity, and half the width of the interval is the
    weighted quantile of the absolute errors. Samples of one run may depend on each other in any way; only the runs have
    to be exchangeable. Folds of single rows would give intervals that are too narrow.

    Parameters
    ----------
    estimator : estimator
        A regressor of one target.
    confidence : float, default=0.9
        Share of the samples of a new run, on average over runs, that the interval holds.
    n_splits : int, default=5
        Folds of whole runs.
    independent_rows : bool, default=False
        Whether to treat each row as a run where nothing names the runs.

    Attributes
    ----------
    estimator_ : estimator
        The regressor, fitted on all runs.
    half_width_ : float
        Half the width of the interval, in the target's unit; infinite if there are too few runs for the
        confidence (at least ``confidence / (1 - confidence)`` are needed).
    n_trajectories_ : int
        Runs that the errors are from.

    References
    ----------
    Y. Lee, R. F. Barber, R. Willett, "Distribution-free inference with hierarchical data", 2023.
    https://doi.org/10.48550/arXiv.2306.06342

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.linear_model import LinearRegression
    >>> from pamid.estimators import ConformalRegressor
    >>> rng = np.random.default_rng(0)
    >>> run = np.repeat(np.arange(20), 50)
    >>> X = rng.normal(size=(1000, 1))
    >>> y = X[:, 0] + rng.normal(size=20)[run]  # every run has an offset of its own
    >>> model = ConformalRegressor(LinearRegression()).fit(X, y, groups=run)
    >>> lower, upper = model.predict_interval(X)
    >>> bool(np.mean((lower < y) & (y < upper)) > 0.8)
    True
    """

    estimator: Any
    _: KW_ONLY
    confidence: float = 0.9
    n_splits: int = 5
    independent_rows: bool = False

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = get_tags(self.estimator).regressor_tags.poor_score
        return tags

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Fit the regressor, and find its errors on unseen runs.

        Parameters
        ----------
        X : DataFrame or array, shape (n_samples, n_columns)
            What the regressor reads.
        y : array, shape (n_samples,)
            Target.
        """
        if not (isinstance(self.confidence, int | float) and 0 < self.confidence < 1):
            raise ParameterError(f"confidence={self.confidence!r}.", "a number between 0 and 1", "Correct it.")
        if not (isinstance(self.n_splits, int | np.integer) and self.n_splits >= 2):
            raise ParameterError(f"n_splits={self.n_splits!r}.", "a whole number of at least 2", "Correct it.")
        validate_data(self, encode_text_columns(X), y, dtype=np.float64, y_numeric=True, ensure_min_samples=2)
        target = column_or_1d(y, warn=True).astype(float)
        codes = trajectory_codes(X, groups)
        if codes is None:
            if not self.independent_rows:
                raise MissingTrajectoryError(
                    f"{type(self).__name__} got neither groups nor a column 'trajectory'.",
                    "one of the two",
                    "Pass groups=, or set independent_rows=True if rows do not depend on each other.",
                )
            codes = np.arange(_num_samples(X))
        names, codes = np.unique(codes, return_inverse=True)
        errors = np.full(len(target), np.inf)
        if len(names) > 1:
            folds = GroupKFold(min(self.n_splits, len(names))).split(codes, groups=codes)
            for train, test in folds:
                part = self._fitted(_rows(X, train), target[train], codes[train])
                errors[test] = np.abs(target[test] - np.asarray(part.predict(_rows(X, test))))
        self.estimator_ = self._fitted(X, target, codes)
        self.n_trajectories_ = len(names)
        weight = 1.0 / np.bincount(codes)[codes] / (len(names) + 1)
        order = np.argsort(errors)
        reached = np.cumsum(weight[order])
        place = int(np.searchsorted(reached, self.confidence - 1e-12))
        self.half_width_ = float(errors[order][place]) if place < len(errors) else np.inf
        if not np.isfinite(self.half_width_):
            warnings.warn(
                f"{len(names)} runs cannot support a confidence of {self.confidence:g}: the interval is "
                f"infinite. Expected at least {int(np.ceil(self.confidence / (1 - self.confidence) - 1e-9))}. Record "
                "more runs, or lower confidence.",
                ExcitationWarning,
                stacklevel=3,
            )
        self._remember(X, y, groups=groups)
        return self

    def _stream_table(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        table = validate_data(self, encode_text_columns(X), dtype=np.float64, reset=False)
        target = column_or_1d(y).astype(float)
        check_consistent_length(table, target)
        return table, target[:, None]

    def _fitted(self, X: Any, y: np.ndarray, codes: np.ndarray) -> Any:
        """Fit a clone; it is told its runs if it asks for them."""
        model = clone(self.estimator)
        if isinstance(model, SignalEstimator) and "groups" in model.fit.__code__.co_varnames:
            return forget(model.fit(X, y, groups=codes))
        return forget(model.fit(X, y))

    def predict(self, X: Any) -> np.ndarray:
        """Predict the target as the regressor does."""
        check_is_fitted(self, "estimator_")
        if plain_table(self, X) is None:
            validate_data(self, encode_text_columns(X), dtype=np.float64, reset=False)
        return np.asarray(self.estimator_.predict(X))

    def predict_interval(self, X: Any) -> PredictionInterval:
        """Return the interval that holds on a new run.

        Returns
        -------
        PredictionInterval
            Lower and upper end at each sample, in the target's unit.
        """
        middle = self.predict(X)
        return PredictionInterval(middle - self.half_width_, middle + self.half_width_)

    @classmethod
    def _checked_instances(cls) -> list[Self]:
        from .geometric_force import GeometricForce

        inner = GeometricForce("cylinder", signals={"eps": 0, "P": 0})
        return [cls(inner, confidence=0.5, n_splits=2, independent_rows=True)]


def _rows(X: Any, index: np.ndarray) -> Any:
    return X.iloc[index] if hasattr(X, "iloc") else np.asarray(X)[index]

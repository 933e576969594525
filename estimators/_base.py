"""What all estimators share: reading named signals from a table, runs, and scikit-learn's contract."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from math import isfinite
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from sklearn.utils.validation import check_array, check_is_fitted, column_or_1d, validate_data

from pamid.errors import MissingColumnError, ParameterError, ShapeError
from pamid.signals.state import STATE_SIGNALS, State

from ._checks import check_squares, row_weights
from ._parameters import TakesFrames, parameters
from ._trajectories import TRAJECTORY, encode_text_columns
from ._typed import BaseEstimator, RegressorMixin

Signals = Mapping[str, "str | int"]


@parameters
class SignalEstimator(TakesFrames, BaseEstimator):
    """Base of every estimator that reads named signals from the columns of X.

    In a DataFrame a signal is found by its name (``eps``, ``deps``, ``P``, ``dP``, ...). A plain array must hold
    exactly the needed signals, in the order of `reads`. The parameter `signals` overrides both: it maps a signal to
    a column, by name or by position, and may send several signals to one column.

    A column named ``trajectory`` in a DataFrame is never a signal: it names each row's run.

    Parameters
    ----------
    signals : mapping of str to (str or int), optional
        Column of a signal, by name or position, where it is not the signal's own name or place.

    Attributes
    ----------
    signal_columns_ : dict of str to int
        Column of each signal.
    """

    reads: ClassVar[tuple[str, ...]] = ()
    """Signals that it reads from X."""
    equations: ClassVar[tuple[str, ...]] = ()
    """Equations of the bench whose measured side this estimator can learn: ``"force"`` (N), ``"flow"`` (kg/s)."""
    joint: ClassVar[bool] = False
    """Whether it learns all of its `equations` at once, from a target with one column each."""
    outputs: ClassVar[tuple[str, ...]] = ("eps", "P")
    """Outputs whose free run it can learn, where its `equations` name the dynamic problem."""
    _settings: ClassVar[Mapping[str, Mapping[str, Any]]] = {"": {}}
    """What `settings` returns, where it is the same for all its `equations`."""
    _checked: ClassVar[Sequence[Mapping[str, Any]]] = ()
    """Parameters of the instances that the common checks run on; without `signals` all are the first column."""

    _: KW_ONLY
    signals: Signals | None = None

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:
        """Return the settings in which a comparison fits this estimator.

        Parameters
        ----------
        equation : str
            One of its `equations`.

        Returns
        -------
        dict of str to dict
            Parameters by a short name, "" for the defaults.
        """
        return {name: dict(given) for name, given in cls._settings.items()}

    @classmethod
    def _checked_instances(cls) -> list[Any]:
        made = [cls(**given) for given in cls._checked]
        for estimator in made:
            if estimator.signals is None:
                estimator.signals = dict.fromkeys(estimator.reads, 0)
        return made

    def _check_fitted(self, attribute: str) -> None:
        """Raise if not fitted, as scikit-learn does; its own look takes a tenth of the time of a prediction."""
        if attribute not in vars(self):
            check_is_fitted(self, attribute)

    def _read(self, X: Any, y: Any = None, *, reset: bool, **checks: Any) -> tuple[np.ndarray, Any]:
        """Validate X and y as scikit-learn does and return them; on `reset`, note which column is which signal."""
        if y is None and not reset and not checks and (plain := plain_table(self, X)) is not None:
            return plain, None
        X = encode_text_columns(X, self._read_columns())
        if y is None and not reset:
            X, y = validate_data(self, X, reset=False, dtype=np.float64, **checks), None
        elif y is None:
            X = validate_data(self, X, reset=True, dtype=np.float64, **checks)
        else:
            X, y = validate_data(self, X, y, reset=reset, dtype=np.float64, y_numeric=True, multi_output=True, **checks)
            check_squares(y)
        if reset:
            self.signal_columns_ = self._locate(X.shape[1])
        return X, y

    def _read_fitted(self, X: Any, attribute: str) -> np.ndarray:
        """Validate X for an estimator whose fit has set an attribute."""
        self._check_fitted(attribute)
        return self._read(X, reset=False)[0]

    def _read_columns(self) -> set[str]:
        """Names of the columns that are read as signals, which must hold numbers."""
        given = self.signals if isinstance(self.signals, Mapping) else {}
        return {str(given.get(name, name)) for name in self.reads}

    def _read_targets(self, X: Any, y: Any, *, reset: bool) -> tuple[np.ndarray, np.ndarray]:
        """Validate X and y, the latter as columns; a target of two columns may hold NaN."""
        shape = np.shape(np.asarray(y)) if y is not None else ()
        if len(shape) != 2 or shape[1] == 1:
            table, target = self._read(X, y, reset=reset)
            return table, column_or_1d(target, warn=True)[:, None]
        table, _ = self._read(X, reset=reset)
        target = check_array(y, dtype=np.float64, ensure_all_finite="allow-nan", input_name="y")
        check_squares(target)
        if target.shape != (len(table), 2):
            raise ShapeError(
                f"y has shape {target.shape} for {len(table)} rows.",
                "two columns, force (N) and flow (kg/s), one row per sample",
                "Pass np.column_stack([F, mdot]).",
            )
        return table, target

    def _read_weighted(
        self, X: Any, y: Any, sample_weight: Any, *, reset: bool, **checks: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Validate X, a target of one column and the weights of the rows."""
        table, y = self._read(X, y, reset=reset, **checks)
        return table, np.asarray(column_or_1d(y, warn=True), dtype=np.float64), row_weights(sample_weight, table)

    def _locate(self, n_columns: int) -> dict[str, int]:
        """Find the column of each needed signal."""
        names = [str(n) for n in getattr(self, "feature_names_in_", ())]
        if self.signals is not None and not isinstance(self.signals, Mapping):
            raise ParameterError(
                f"signals is a {type(self.signals).__name__}.",
                "a mapping of signal names to columns",
                "Pass for instance signals={'eps': 'contraction', 'P': 2}.",
            )
        given = dict(self.signals or {})
        unknown = sorted(set(given) - set(self.reads))
        if unknown:
            raise ParameterError(
                f"signals maps {', '.join(unknown)}, which {type(self).__name__} does not read.",
                f"only {', '.join(self.reads)}",
                "Remove the surplus entries.",
            )
        if not names and not given and n_columns != len(self.reads):
            raise ShapeError(
                f"X is an array with {n_columns} columns and no names.",
                f"{len(self.reads)} columns ({', '.join(self.reads)})",
                "Pass a DataFrame with these names, or signals={name: column}.",
            )
        return {
            signal: self._column(given.get(signal, signal if names else position), names, n_columns, signal)
            for position, signal in enumerate(self.reads)
        }

    def _column(self, column: str | int, names: list[str], n_columns: int, signal: str) -> int:
        if isinstance(column, str):
            if column not in names:
                raise MissingColumnError(
                    f"X has no column '{column}' for the signal {signal}; it has {', '.join(names) or 'no names'}.",
                    f"the columns {', '.join(self.reads)}",
                    f"Rename the column, or pass signals={{'{signal}': <its column>}}.",
                )
            return names.index(column)
        if not 0 <= int(column) < n_columns:
            raise MissingColumnError(
                f"signals sends {signal} to column {column}, but X has {n_columns} columns.",
                f"a position from 0 to {n_columns - 1}",
                "Correct the position.",
            )
        return int(column)

    def _signal(self, X: np.ndarray, name: str) -> np.ndarray:
        """Return one signal of the validated table, shape (n_samples,)."""
        return X[:, self.signal_columns_[name]]

    def _signals(self, X: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Return some signals of the validated table, shape (n_samples, n_names)."""
        return np.column_stack([self._signal(X, name) for name in names])


class SignalRegressor(RegressorMixin, SignalEstimator):
    """A regressor on signals; a random table, whose columns mean nothing, is fitted poorly."""

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True
        return tags


def state_of(estimator: Any, X: np.ndarray) -> State:
    """Return the signals of a muscle's state in a validated table; what an estimator does not read is zero."""
    columns, zero = estimator.signal_columns_, np.zeros(X.shape[0])
    return State(*(X[:, columns[s]] if s in columns else zero for s in STATE_SIGNALS))


def fitted_attributes(estimator: Any) -> dict[str, Any]:
    """Return the fitted attributes, by name."""
    return {name: value for name, value in vars(estimator).items() if name.endswith("_") and not name.startswith("_")}


_MATCHED: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()
"""The columns that an estimator has found to be those of its fit: rows of one table share them."""


def plain_table(estimator: Any, X: Any) -> np.ndarray | None:
    """Return X if it is already what validation would return, else None: on one row, validation outweighs the model."""
    names = getattr(estimator, "feature_names_in_", None)
    if type(X) is np.ndarray:
        table = X if names is None else None
    elif names is not None and hasattr(X, "to_numpy") and X.shape[1] == len(names):
        known = X.columns.is_(_MATCHED.get(estimator))
        if not known and (known := X.columns.tolist() == (wanted := names.tolist()) and TRAJECTORY not in wanted):
            _MATCHED[estimator] = X.columns
        table = X.to_numpy() if known else None
    else:
        table = None
    if table is None or table.dtype != np.float64 or table.ndim != 2 or not len(table):
        return None
    # A sum is finite only if all numbers are; the validation handles overflow.
    if table.shape[1] != estimator.n_features_in_ or not isfinite(table.sum()):
        return None
    return table


__all__ = [
    "TRAJECTORY",
    "SignalEstimator",
    "SignalRegressor",
    "Signals",
    "fitted_attributes",
    "plain_table",
    "state_of",
]

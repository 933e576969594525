"""Rates of measured signals as a step of a pipeline."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import _check_feature_names_in, check_is_fitted, validate_data

from pamid.errors import (
    DuplicateColumnError,
    MissingColumnError,
    ParameterError,
    SamplingWarning,
    ShapeError,
    ShortTrajectoryError,
)
from pamid.signals.driven import differentiate_driven, fit_gains
from pamid.signals.rates import differentiate, irregularity, tune_cutoff

from ._parameters import TakesFrames, parameters
from ._streaming import SequenceStreaming
from ._trajectories import encode_text_columns, run_codes, trajectory_slices
from ._typed import BaseEstimator, TransformerMixin


@parameters
class RateTransformer(TakesFrames, SequenceStreaming, TransformerMixin, BaseEstimator):
    """Append the rates of columns, taken within each run.

    For each column ``x`` a column ``dx`` with its rate is appended; rows keep their number and order. Smoothing adapts
    to the signals: `fit` chooses one cut-off frequency per column over all runs, and `transform` uses it on any later
    log.

    Parameters
    ----------
    columns : sequence of str or int, default=("eps", "P")
        Columns to differentiate, by name or position. An array, which has no names, holds the time and then these
        columns in their order, or with `sampling_period` these columns alone.
    time : str, int or None, default="time"
        Column with the time, s, by name or position. Where X has no such column, `sampling_period` serves.
    method : {"savgol", "spline", "kalman"}, default="savgol"
        Savitzky-Golay filter, cubic smoothing spline, or Kalman/RTS smoother of constant acceleration.
    tuning : "auto", float or sequence of float, default="auto"
        Cut-off frequency, Hz, one for all or one per column; "auto": the one with the least estimated squared error of
        the rate (Stein's unbiased risk estimate for the derivative, DOI 10.1214/aos/1176345632).
    inputs : mapping of column to sequence of columns, optional
        Known inputs that make the rate of a column jump, such as ``{"P": ["flow"]}`` with the flow that the valve's law
        gives at its command. Each holds from a row to the next; how strongly it drives the rate is identified, and what
        it leaves is smoothed, by any method (`pamid.signals.driven`). The rate is then the one after the jump.
    smooth : bool, default=False
        Whether to replace the columns themselves by their smoothed values.
    second : bool, default=False
        Whether to append the second rates too, as ``ddx``.
    sampling_period : float or None, default=None
        Time between rows, s, where there is no time column.

    Attributes
    ----------
    cutoffs_ : ndarray, shape (n_columns,)
        Cut-off frequency of each column, Hz.
    column_indices_ : ndarray of int, shape (n_columns,)
        Position of each column.
    input_indices_ : dict of int to list of int
        Positions of the inputs of each column that has any, by its place in `columns`.
    gains_ : dict of int to ndarray
        What one unit of each input adds to the rate, likewise.
    time_index_ : int or None
        Position of the time column.

    See Also
    --------
    pamid.signals.differentiate : The same for arrays of one run.

    Notes
    -----
    Rates of the rows near the ends of a run rest on fewer neighbours and are less certain. Rates depend on
    neighbouring rows: take them on whole runs, before rows are thinned.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from pamid.estimators import RateTransformer
    >>> t = np.arange(0, 2, 0.01)
    >>> log = pd.DataFrame({"trajectory": "sine-1", "time": t, "eps": 0.1 * np.sin(t)})
    >>> with_rates = RateTransformer(columns=["eps"]).fit_transform(log)
    >>> list(with_rates.columns)
    ['trajectory', 'time', 'eps', 'deps']
    >>> bool(np.abs(with_rates["deps"] - 0.1 * np.cos(t)).max() < 1e-4)
    True
    """

    columns: Sequence[str | int] = ("eps", "P")
    _: KW_ONLY
    time: str | int | None = "time"
    method: str = "savgol"
    tuning: str | float | Sequence[float] = "auto"
    inputs: Mapping[Any, Sequence[Any]] | None = None
    smooth: bool = False
    second: bool = False
    sampling_period: float | None = None
    one_trajectory: bool = False

    @staticmethod
    def _checked_instances() -> list[RateTransformer]:
        return [
            RateTransformer(columns=(0,), time=None, sampling_period=0.1, method=method, one_trajectory=True)
            for method in ("savgol", "spline", "kalman")
        ]

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # scikit-learn has no tag for rows that depend on their neighbours: this one leaves out the checks that
        # transform shuffled and single rows. The others that it leaves out are run in pamid's own tests.
        tags.non_deterministic = bool(self.one_trajectory)
        return tags

    def fit(self, X: Any, y: Any = None, groups: Any = None) -> RateTransformer:
        """Choose the cut-off frequency of each column over all runs.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_features)
            Table whose rows are samples in time order, run by run.
        y : None
            Ignored.

        Raises
        ------
        MissingTrajectoryError
            If nothing says which rows form a run.
        MissingColumnError
            If a column is missing, or there is neither time nor `sampling_period`.
        """
        table = self._table(X, ensure_min_samples=2)
        names = [str(n) for n in getattr(self, "feature_names_in_", [])]
        if isinstance(self.columns, str) or not len(self.columns):
            raise ParameterError(
                f"columns is {self.columns!r}.", "a sequence of names or positions", "Pass for instance ['q', 'P1']."
            )
        if names or not any(isinstance(c, str) for c in self.columns):
            self.column_indices_ = np.array([self._position(c, names, table.shape[1], "columns") for c in self.columns])
            self.time_index_ = self._find_time(names, table.shape[1])
        else:
            self.column_indices_, self.time_index_ = self._in_order_of_array(table.shape[1])
        self.input_indices_ = self._find_inputs(names, table.shape[1])
        doubled = sorted(set(self._new_names(self._names())) & set(names))
        if doubled:
            raise DuplicateColumnError(
                f"X already has the column{'s' if len(doubled) > 1 else ''} {', '.join(doubled)}.",
                "no column with the name of a rate to be made",
                "Drop or rename them, or leave their signals out of columns.",
            )
        slices = self._slices(X, table, groups)
        times = [self._times(table, rows) for rows in slices]
        if isinstance(self.tuning, str) and self.tuning == "auto":
            self.cutoffs_ = np.array(
                [
                    tune_cutoff(
                        [table[rows, column] for rows in slices],
                        None if self.time_index_ is None else times,
                        method=self.method,
                        sampling_period=self.sampling_period,
                    )
                    for place, column in enumerate(self.column_indices_)
                    if place not in self.input_indices_
                ]
            )
        else:
            rows = slices[0]
            differentiate(  # words the errors of method, tuning and period
                table[rows][:, self.column_indices_],
                times[0],
                method=self.method,
                tuning=self.tuning,
                sampling_period=self.sampling_period,
                warn=False,
            )
            self.cutoffs_ = np.broadcast_to(np.asarray(self.tuning, float), self.column_indices_.shape).copy()
        self._fit_gains(table, slices)
        self._remember(X, None, groups=groups)
        return self

    def partial_fit(self, X: Any, y: Any = None, groups: Any = None) -> RateTransformer:
        """Choose the cut-off frequencies over the runs of all calls.

        They are those of one `fit` on all runs up to 20,000 rows; above, those of a random sample of whole ones.
        A repeated run adds nothing.
        """
        return self._partial_fit_rows(X, y, None, groups)

    def _stream_table(self, X: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
        table = self._table(X, reset=False)
        return table, np.zeros((len(table), 1))

    def _stream_codes(self, X: Any, table: np.ndarray, groups: Any) -> np.ndarray:
        return run_codes(self, X if isinstance(X, pd.DataFrame) else table, groups)

    def transform(self, X: Any, groups: Any = None) -> Any:
        """Append the rates, in units of the columns per s.

        Raises
        ------
        ShortTrajectoryError
            If a run has fewer than two rows.
        """
        check_is_fitted(self, "cutoffs_")
        table = self._table(X, reset=False)
        smoothed = np.empty((len(table), len(self.column_indices_)))
        rates = [np.empty_like(smoothed) for _ in range(2 if self.second else 1)]
        slices = self._slices(X, table, groups)
        times = [self._times(table, rows) for rows in slices]
        told = [text for t in times if t is not None and (text := irregularity(t))]
        if told:
            warnings.warn(
                f"{len(told)} of {len(slices)} runs are not sampled evenly. {told[0]}", SamplingWarning, stacklevel=4
            )
        for rows in slices:
            results = differentiate(
                table[rows][:, self.column_indices_],
                self._times(table, rows),
                warn=False,
                method=self.method,
                tuning=self.cutoffs_,
                sampling_period=self.sampling_period,
                second=self.second,
            )
            smoothed[rows] = results[0]
            for whole, part in zip(rates, results[1:], strict=True):
                whole[rows] = part
            for place, columns in self.input_indices_.items():
                smoothed[rows, place], rates[0][rows, place] = differentiate_driven(
                    table[rows, self.column_indices_[place]],
                    table[rows][:, columns],
                    self._clock(table, rows),
                    self.gains_[place],
                    cutoff=self.cutoffs_[place],
                    method=self.method,
                )
        asked = getattr(self, "_sklearn_output_config", {}).get("transform")
        if isinstance(X, pd.DataFrame) and asked != "default":
            names = self._names()
            out = X.copy()
            if self.smooth:
                for i, column in enumerate(self.column_indices_):
                    out[X.columns[column]] = smoothed[:, i]
            values = np.concatenate(rates, axis=1)
            appended = pd.DataFrame(values, columns=self._new_names(names), index=X.index)
            return pd.concat([out, appended], axis=1)
        if self.smooth:
            table = table.copy()
            table[:, self.column_indices_] = smoothed
        return np.concatenate([table, *rates], axis=1)

    def fit_transform(self, X: Any, y: Any = None, groups: Any = None) -> Any:
        """Fit to X and append the rates to it."""
        return self.fit(X, y, groups=groups).transform(X, groups=groups)

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """Name the columns that `transform` returns: those of X, ``d<name>`` for each, ``dd<name>`` with `second`."""
        check_is_fitted(self, "cutoffs_")
        names = _check_feature_names_in(self, input_features)
        return np.array([*names, *self._new_names([str(n) for n in names])], dtype=object)

    def _find_inputs(self, names: list[str], n_columns: int) -> dict[int, list[int]]:
        """Return the positions of the inputs, by the place of their column in `columns`."""
        found: dict[int, list[int]] = {}
        for column, inputs in (self.inputs or {}).items():
            if isinstance(inputs, str) or not len(inputs) or column not in list(self.columns):
                raise ParameterError(
                    f"inputs is {self.inputs!r} with columns={list(self.columns)!r}.",
                    "for some of these columns a sequence of input columns",
                    "Pass for instance inputs={'P': ['flow']}.",
                )
            if self.second:
                raise ParameterError(
                    "second=True with inputs.",
                    "one of them",
                    "The second rate of a signal whose rate jumps is not finite.",
                )
            place = list(self.columns).index(column)
            found[place] = [self._position(c, names, n_columns, "inputs") for c in inputs]
        return found

    def _fit_gains(self, table: np.ndarray, slices: list[slice]) -> None:
        """Identify what the inputs do, and choose the cut-off of what they leave."""
        self.gains_: dict[int, np.ndarray] = {}
        automatic = isinstance(self.tuning, str)
        for place, columns in sorted(self.input_indices_.items()):
            self.gains_[place], cutoff = fit_gains(
                [table[rows, self.column_indices_[place]] for rows in slices],
                [table[rows][:, columns] for rows in slices],
                [self._clock(table, rows) for rows in slices],
                method=self.method,
                tuning="auto" if automatic else float(self.cutoffs_[place]),
            )
            if automatic:
                self.cutoffs_ = np.insert(self.cutoffs_, place, cutoff)

    def _clock(self, table: np.ndarray, rows: slice) -> np.ndarray:
        """Times of a run, s."""
        times = self._times(table, rows)
        return np.arange(rows.stop - rows.start) * float(self.sampling_period or 1.0) if times is None else times

    def _names(self) -> list[str]:
        return [str(n) for n in _check_feature_names_in(self)]

    def _new_names(self, names: list[str]) -> list[str]:
        own = [names[i] for i in self.column_indices_]
        return [f"{d}{n}" for d in (("d", "dd") if self.second else ("d",)) for n in own]

    def _table(self, X: Any, **checks: Any) -> np.ndarray:
        table: np.ndarray = validate_data(
            self, encode_text_columns(X, self._read_columns()), dtype=np.float64, **checks
        )
        return table

    def _slices(self, X: Any, table: np.ndarray, groups: Any) -> list[slice]:
        slices = trajectory_slices(self._stream_codes(X, table, groups))
        short = next((s for s in slices if s.stop - s.start < 2), None)
        if short is not None:
            raise ShortTrajectoryError(
                f"{type(self).__name__} got a run of 1 sample, in row {short.start + 1}.",
                "at least 2 samples in each run",
                "Pass whole runs: a rate needs neighbours.",
            )
        return slices

    def _times(self, table: np.ndarray, rows: slice) -> np.ndarray | None:
        return None if self.time_index_ is None else table[rows, self.time_index_]

    def _find_time(self, names: list[str], n_columns: int) -> int | None:
        named = isinstance(self.time, str)
        if self.time is None or (named and self.time not in names):
            if self.sampling_period is None:
                raise MissingColumnError(
                    f"X has no time column{f' {self.time!r}' if named else ''}; it has "
                    f"{', '.join(names) or f'{n_columns} columns without names'}.",
                    "a time column, or sampling_period",
                    "Name the column with time=, or give the time between rows with sampling_period=.",
                )
            return None
        return self._position(self.time, names, n_columns, "time")

    def _read_columns(self) -> set[str]:
        """Names of the columns that must hold numbers."""
        driving = [c for inputs in (self.inputs or {}).values() if not isinstance(inputs, str) for c in inputs]
        return {str(c) for c in (*self.columns, self.time, *driving) if isinstance(c, str)}

    def _in_order_of_array(self, n_columns: int) -> tuple[np.ndarray, int | None]:
        """Return where columns and time stand in an array without names: the columns in their order, time before."""
        n = len(self.columns)
        timed = n_columns == n + 1 and self.time is not None
        if not timed and (n_columns != n or self.sampling_period is None):
            raise ShapeError(
                f"X is an array with {n_columns} columns and no names.",
                f"{n + 1} columns (time, {', '.join(map(str, self.columns))}), or the last {n} and sampling_period",
                "Pass these, a DataFrame, or the positions of the columns as columns= and time=.",
            )
        return np.arange(n) + int(timed), 0 if timed else None

    @staticmethod
    def _position(column: str | int, names: list[str], n_columns: int, parameter: str) -> int:
        if isinstance(column, str):
            if column in names:
                return names.index(column)
            raise MissingColumnError(
                f"X has no column '{column}'; it has {', '.join(names) or f'{n_columns} columns without names'}.",
                f"the columns that {parameter} names",
                f"Set {parameter} to columns of X, by name or position.",
            )
        if not 0 <= column < n_columns:
            raise MissingColumnError(
                f"{parameter} asks for column {column}, but X has {n_columns} columns.",
                f"a position from 0 to {n_columns - 1}",
                "Correct the position.",
            )
        return int(column)

"""Which rows belong to which run: ``groups`` where routing brings it, a column where it does not."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import _num_samples

from pamid.errors import ColumnTypeError, InterleavedTrajectoryError, MissingTrajectoryError, ShapeError
from pamid.signals.stretches import equal_stretches

TRAJECTORY = "trajectory"
"""Name of the column that says to which run a row belongs."""


def has_trajectory_column(X: Any) -> bool:
    """Return whether X is a DataFrame with a ``trajectory`` column."""
    return isinstance(X, pd.DataFrame) and TRAJECTORY in X.columns


def encode_text_columns(X: Any, read: Collection[str] = ()) -> Any:
    """Encode text in columns that are not signals, such as ``trajectory``, as numbers; other inputs stay untouched."""
    if not isinstance(X, pd.DataFrame):
        return X
    coded = {}
    for name in X.columns:
        if pd.api.types.is_numeric_dtype(X[name]) or pd.api.types.is_complex_dtype(X[name]):
            continue
        if name != TRAJECTORY and (text := _first_text(X[name])) is None:
            continue
        if name in read:
            raise ColumnTypeError(
                f"The column {name} holds text ({text!r}).",
                "numbers",
                f"Map the log's columns, or say with signals= which column holds {name}.",
            )
        coded[name] = pd.factorize(X[name])[0].astype(float)
    return X.assign(**coded) if coded else X


def _first_text(column: pd.Series[Any]) -> Any:
    """Return the first value that is not a number, None if there is none."""
    for value in column.unique():
        try:
            float(value)
        except (TypeError, ValueError):
            return value
    return None


def trajectory_codes(
    X: Any, groups: Any, *, one_trajectory: bool = False, needed_by: str | None = None
) -> np.ndarray | None:
    """Number the runs of the rows of X from 0, in order of appearance."""
    n = _num_samples(X)
    keys = []
    if groups is not None:
        groups = np.asarray(groups).ravel()
        if groups.shape[0] != n:
            raise ShapeError(
                f"groups has {groups.shape[0]} entries for {n} rows.",
                "one entry per row",
                "Pass one group for each row.",
            )
        keys.append(pd.factorize(groups)[0])
    if has_trajectory_column(X):
        keys.append(pd.factorize(X[TRAJECTORY])[0])
    if not keys:
        if one_trajectory:
            return np.zeros(n, dtype=int)
        if needed_by is None:
            return None
        raise MissingTrajectoryError(
            f"{needed_by} needs to know which rows form a run, and got neither groups nor a column '{TRAJECTORY}'.",
            "one of the two",
            "Pass groups= (with metadata routing on, or directly to fit), keep a 'trajectory' column in a DataFrame "
            "(serves with routing off), or set one_trajectory=True if all rows are one run.",
        )
    codes = keys[0] if len(keys) == 1 else pd.factorize(keys[0].astype(np.int64) * (keys[1].max() + 1) + keys[1])[0]
    if needed_by is not None:
        blocks = equal_stretches(codes)
        if len(blocks) != len(np.unique(codes)):
            raise InterleavedTrajectoryError(
                f"{needed_by} got {len(np.unique(codes))} runs in {len(blocks)} separate blocks of rows.",
                "the rows of each run to be contiguous and in time order",
                "Sort the table by run and time, and do not shuffle rows.",
            )
    return codes


def run_codes(estimator: Any, X: Any, groups: Any, *, one_trajectory: bool | None = None) -> np.ndarray:
    """Number the runs for an estimator that needs them; its `one_trajectory` says what holds where nothing does."""
    one = estimator.one_trajectory if one_trajectory is None else one_trajectory
    codes = trajectory_codes(X, groups, one_trajectory=one, needed_by=type(estimator).__name__)
    assert codes is not None  # needed_by raises instead
    return codes


def trajectory_slices(codes: np.ndarray) -> list[slice]:
    """Return the rows of each run as slices, for codes that are contiguous."""
    return [slice(a, b) for a, b in equal_stretches(codes)]

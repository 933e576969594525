"""Data frames of polars and pyarrow are taken by estimators, diagnoses and readers as pandas' are."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from pamid.estimators import (
    ConformalRegressor,
    PolynomialForce,
    RateTransformer,
    all_estimators,
)

import pamid
from pamid.bench import BenchParameters, simulate, sine, unfold
from pamid.equations import evaluate_log
from pamid.errors import ColumnTypeError, ParameterError
from pamid.signals import read_log, write_log
from pamid.signals.frames import as_pandas

BENCH = BenchParameters.for_muscle("B")


class LikePolars:
    """A frame with what polars' has and nothing of pandas': columns, their values and to_pandas."""

    def __init__(self, table: pd.DataFrame) -> None:
        self.table, self.columns, self.shape = table, list(table.columns), table.shape

    def __getitem__(self, name: str) -> Any:
        return self.table[name].to_numpy()

    def __len__(self) -> int:
        return len(self.table)

    def to_pandas(self) -> pd.DataFrame:
        return self.table.reset_index(drop=True)


class LikeLazy:
    """A lazy frame: columns, and no values."""

    columns = ("eps", "P")


LikePolars.__module__, LikeLazy.__module__ = "polars.dataframe.frame", "polars.lazyframe.frame"


def of_polars(table: pd.DataFrame) -> Any:
    return pl.from_pandas(table)


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    return simulate(BENCH, [sine(4, 15, 400), sine(8, 10, 400)], effects=["leakage"], seed=0)


@pytest.mark.parametrize(
    "kind", [LikePolars, pa.Table.from_pandas, of_polars], ids=["like polars", "pyarrow", "polars"]
)
def test_estimators_answer_as_for_pandas(kind: Any, log: pd.DataFrame) -> None:
    table = unfold(log, BENCH)
    F = table["F"].to_numpy()
    X = table[["trajectory", "time", "eps", "P"]]
    frame = kind(X)
    rates = RateTransformer()
    whole = rates.fit_transform(frame)
    assert list(whole.columns) == [*X.columns, "deps", "dP"]
    np.testing.assert_array_equal(whole["deps"], RateTransformer().fit_transform(X)["deps"])
    model = PolynomialForce(degree=2).fit(frame, F)
    assert list(model.feature_names_in_) == list(X.columns)
    np.testing.assert_array_equal(model.predict(frame), PolynomialForce(degree=2).fit(X, F).predict(X))
    assert model.partial_fit(frame, F).score(frame, F) == pytest.approx(model.score(X, F))
    np.testing.assert_array_equal(model.volume(frame).V, model.volume(X).V)
    wrapped = ConformalRegressor(PolynomialForce(degree=2)).fit(frame, F)
    np.testing.assert_array_equal(wrapped.predict(frame), wrapped.predict(X))


def test_every_method_that_reads_X_takes_them() -> None:
    """Also one that comes from a mixin of the package: none is forgotten."""
    forgotten = [
        f"{name}.{method}"
        for name, cls in all_estimators()
        for method, f in inspect.getmembers(cls, inspect.isfunction)
        if not method.startswith("_") and f.__module__.startswith("pamid.") and not hasattr(f, "takes_frames")
        if [*inspect.signature(f).parameters][1:2] == ["X"]
    ]
    assert forgotten == []


@pytest.mark.parametrize(
    "kind", [LikePolars, pa.Table.from_pandas, of_polars], ids=["like polars", "pyarrow", "polars"]
)
def test_logs_are_diagnosed_as_those_of_pandas(kind: Any, log: pd.DataFrame, tmp_path: Path) -> None:
    frame = kind(log)
    found = pamid.diagnose(frame, BENCH, ["leakage", "flow_bias"])
    assert found.causes[0].effects == ("leakage",)
    assert pamid.diagnose({"one": frame}, BENCH, ["leakage"]).causes[0].effects == ("leakage",)
    assert evaluate_log(frame, BENCH)["flow"].rmse == evaluate_log(log, BENCH)["flow"].rmse
    assert pamid.evaluate(frame, BENCH)["flow"].rmse == evaluate_log(log, BENCH)["flow"].rmse
    pd.testing.assert_frame_equal(unfold(frame, BENCH), unfold(log.reset_index(drop=True), BENCH), check_dtype=False)
    assert len(read_log(write_log(frame, tmp_path / "log.parquet"))) == len(log)


def test_a_lazy_frame_is_refused_in_a_sentence() -> None:
    with pytest.raises(ColumnTypeError, match=r"has no values yet\. Expected .* Call its collect\(\) first"):
        PolynomialForce().fit(LikeLazy(), [1.0])
    with pytest.raises(ColumnTypeError, match="collect"):
        pamid.diagnose(LikeLazy(), BENCH)  # type: ignore[arg-type]


def test_a_table_in_place_of_a_file_is_refused_in_a_sentence(log: pd.DataFrame) -> None:
    for table in (log, LikePolars(log)):
        with pytest.raises(ParameterError, match="a table already"):
            read_log(table)  # type: ignore[arg-type]


def test_other_tables_come_back_untouched(log: pd.DataFrame) -> None:
    rows = [[0.1, 2e5]]
    assert as_pandas(log) is log and as_pandas(rows) is rows

"""Columns that are the clock, whatever the language of their header."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.errors import MissingColumnError
from pamid.signals import read_log
from pamid.signals.guess import guess_columns

NAMES = ["temps", "tiempo", "tempo [s]", "tijd", "czas", "Время [с]", "时间", "時間(s)", "rel. time"]


@pytest.mark.parametrize("name", NAMES)
def test_a_clock_is_known_by_its_name(name: str) -> None:
    table = pd.DataFrame({name: 0.01 * np.arange(50), "Kraft [N]": np.sin(np.arange(50.0))})
    (guess,) = (g for g in guess_columns(table) if g.column == name)
    assert (guess.signal, guess.gauge) == ("time", None)


@pytest.mark.parametrize("name, step", [("time", 0.1), ("Time", 0.1), ("TIME [ms]", 100)])
def test_the_column_called_time_is_the_clock_with_or_without_a_mapping(tmp_path, name: str, step: float) -> None:
    table = pd.DataFrame({name: step * np.arange(4), "v": [36.0, 18.0, 9.0, 0.0]})
    table.to_csv(tmp_path / "log.csv", index=False)
    for mapping in (None, {"signals": {"v": {"column": "v", "unit": "km/h"}}}):
        read = read_log(tmp_path / "log.csv", mapping)
        assert read["time"].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
        assert set(read) == {"trajectory", "time", "v"}
        assert read["v"].iloc[0] == pytest.approx(36.0 if mapping is None else 10.0)


@pytest.mark.parametrize(("head", "factor"), [("Zeit [s]", 1.0), ("t (ms)", 1e-3), ("elapsed [min]", 60.0)])
def test_a_clock_with_its_unit_needs_no_mapping(head: str, factor: float, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    pd.DataFrame({head: np.arange(4.0), "x [mm]": [1.0, 2.0, 3.0, 5.0]}).to_csv(path, index=False)
    np.testing.assert_allclose(read_log(path)["time"], factor * np.arange(4.0))


def test_of_two_clocks_none_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    pd.DataFrame({"t [s]": [0.0, 1.0], "clock [s]": [5.0, 6.0], "x [mm]": [1.0, 2.0]}).to_csv(path, index=False)
    with pytest.raises(MissingColumnError, match="has no time"):
        read_log(path)

"""Columns that are the clock, whatever the language of their header."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pamid.signals.guess import guess_columns

NAMES = ["temps", "tiempo", "tempo [s]", "tijd", "czas", "Время [с]", "时间", "時間(s)", "rel. time"]


@pytest.mark.parametrize("name", NAMES)
def test_a_clock_is_known_by_its_name(name: str) -> None:
    table = pd.DataFrame({name: 0.01 * np.arange(50), "Kraft [N]": np.sin(np.arange(50.0))})
    (guess,) = (g for g in guess_columns(table) if g.column == name)
    assert (guess.signal, guess.gauge) == ("time", None)

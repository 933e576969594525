"""``pamid init`` with a clock that counts rows and states no unit."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main


@pytest.mark.parametrize(
    ("header", "seconds", "more", "unit"),
    [
        ("Time", 1.0, (), "s"),
        ("Time", 1e-3, (), "ms"),  # what the states then do
        ("Time", 60.0, (), "min"),
        ("Time", 1e-3, ("--equation", "w = x", "--set", "x=0.1"), "s"),  # none of them is logged
        ("Time [ms]", 1.0, (), "ms"),
        ("Time", 1.0, ("--signal", "time=Time:ms"), "ms"),
    ],
)
def test_the_unit_of_a_clock_is_that_of_the_states(
    header: str, seconds: float, more: tuple[str, ...], unit: str, tmp_path: Path
) -> None:
    u = 1.0 + np.sin(np.arange(300) / 12.0)
    x = np.zeros(300)
    for k in range(299):
        x[k + 1] = x[k] + 0.05 * (u[k] - x[k])
    names = {header: np.arange(300), "u": u, "w" if "w = x" in more else "x": x}
    pd.DataFrame(names).to_csv(tmp_path / "log.csv", index=False)
    argv = ["init", str(tmp_path / "log.csv"), "--equation", "dx/dt = (u - x)/T", "--set", f"T={seconds / 0.05} s"]
    assert main([*argv, *more, "--yes", "--quiet", "--json", "--out", str(tmp_path / "setup")]) == 0
    text = (tmp_path / "setup" / "columns.toml").read_text()
    assert tomllib.loads(text)["signals"]["time"]["unit"] == unit
    assert ("ASSUMED" in text) == ((not more and header == "Time") or "w = x" in more)

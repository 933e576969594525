"""Signals of one's own simulator with the names of other quantities: a torque T, absolute pressures p1."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid import read_log
from pamid.simulators import EquationSimulator, Port

N = 200


@pytest.fixture
def shaft(tmp_path: Path) -> tuple[Path, EquationSimulator]:
    """A log with torques of both signs, and the simulator of the shaft."""
    t = 0.02 * np.arange(N)
    pd.DataFrame({"trajectory": "a", "time": t, "T": np.sin(3.0 * t), "w": 1.0 - np.cos(3.0 * t)}).to_csv(
        tmp_path / "log.csv", index=False
    )
    ports = [Port("T", "input", "N m"), Port("w", "state", "rad/s")]
    return tmp_path / "log.csv", EquationSimulator({"dw/dt": "3*T"}, ports)


def test_a_torque_is_no_temperature(shaft, recwarn):
    path, simulator = shaft
    log = read_log(path, simulator=simulator)
    assert np.isfinite(log["T"]).all() and log["T"].min() < -0.9
    mapped = read_log(path, {"time": "time", "w": "w", "T": {"column": "T", "unit": "N m", "own": True}})
    assert np.isfinite(mapped["T"]).all()
    assert not [w for w in recwarn if "cannot be" in str(w.message)]


def test_a_temperature_is_still_one(shaft):
    path, _ = shaft
    with pytest.warns(match="cannot be"):
        log = read_log(path, nan="keep", check_units=False)
    assert np.isnan(log["T"]).any()


def test_a_pressure_that_is_given_as_absolute_stays_so(tmp_path: Path):
    t = 0.02 * np.arange(N)
    p1 = 3.1 + np.sin(t) ** 2
    pd.DataFrame({"trajectory": "a", "time": t, "p1": p1, "x": np.sin(t)}).to_csv(tmp_path / "log.csv", index=False)
    ports = [Port("p1", "input", "Pa"), Port("x", "state", "m")]
    simulator = EquationSimulator({"dx/dt": "1e-6*p1"}, ports)
    mapping = {"time": "time", "x": "x", "p1": {"column": "p1", "unit": "bar", "gauge": False}}
    assert read_log(tmp_path / "log.csv", mapping, simulator=simulator)["p1"].to_numpy() == pytest.approx(1e5 * p1)
    plain = read_log(tmp_path / "log.csv", mapping)  # p1 of pamid itself is gauge pressure
    assert plain["p1"].to_numpy() == pytest.approx(1e5 * p1 - 101_325.0)

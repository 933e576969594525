"""Columns as a simulator file names them: with their unit, without it, mistyped, or of a sensor that is not there."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid import evaluate
from pamid.errors import MissingColumnError, SimulatorWarning
from pamid.signals import read_log
from pamid.simulators import EquationSimulator, Port
from pamid.simulators.port_log import PortLog, port_log

T = np.arange(0.0, 4.0, 0.01)
TABLE = {"time": T, "i [A]": np.cos(T), "phi [deg]": 180 / np.pi * np.sin(T), "om [rad/s]": np.cos(T), "x2": 0 * T}


def simulator(i: str = "i", phi: str = "phi", omega: str = "om") -> EquationSimulator:
    ports = [
        Port("current", "input", "A", column=i), Port("angle", "state", "rad", column=phi),
        Port("speed", "state", "rad/s", column=omega),
    ]  # fmt: skip
    return EquationSimulator({"dangle/dt": "speed", "dspeed/dt": "current - speed"}, ports, {})


def at_ports(folder: Path, made: EquationSimulator) -> PortLog:
    pd.DataFrame(TABLE).to_csv(folder / "log.csv", index=False)
    return port_log(read_log(folder / "log.csv", simulator=made), made)


@pytest.mark.parametrize("phi", ["phi", "phi [deg]"])
@pytest.mark.parametrize("i", ["i", "i [A]"])
def test_a_header_is_found_with_its_unit_and_without(i: str, phi: str, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = at_ports(tmp_path, simulator(i, phi))
    assert found.channels["angle"] == pytest.approx(np.sin(T)) and np.array_equal(found.channels["current"], np.cos(T))
    assert not found.notes


def test_a_mistyped_column_of_a_state_is_warned_of(tmp_path: Path) -> None:
    with pytest.warns(SimulatorWarning, match="lacks the column Phi .* By Phi, is phi meant?"):
        found = at_ports(tmp_path, simulator(phi="Phi"))
    assert set(found.channels) == {"current", "speed"} and "angle counts as not logged" in found.notes[0]


def test_a_sensor_that_is_not_there_is_only_noted(tmp_path: Path) -> None:
    """Not even if a column of another port, or the clock, is called almost like it."""
    for column in ("encoder", "om2", "tim"):
        made = simulator(phi=column)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = at_ports(tmp_path, made)
        assert found.notes == [
            f"The log lacks the column {column} that the simulator file names for angle: angle counts as not logged."
        ]


def test_errors_name_the_columns_that_may_be_meant(tmp_path: Path) -> None:
    with pytest.raises(MissingColumnError, match=r"By I, is i meant\?"):
        at_ports(tmp_path, simulator(i="I"))
    with pytest.raises(MissingColumnError, match=r"By Phi, is phi meant\? By oms, is om meant?"):
        at_ports(tmp_path, simulator(phi="Phi", omega="oms"))


def test_tables_of_ones_own_are_warned_of_too() -> None:
    log = pd.DataFrame({"time": T, "i": np.cos(T), "phi": np.sin(T), "om": np.cos(T)})
    with pytest.warns(SimulatorWarning, match="is phi meant"):
        evaluate(log, simulator(phi="PHI"))

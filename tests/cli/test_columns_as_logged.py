"""``pamid init``: what a header's last word is, what a port without a unit gets, and which column the user names."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid import read_simulator
from pamid.cli import main
from pamid.signals import read_log

T = np.arange(0.0, 6.0, 0.02)
RUN = """
kind = "run"
[run]
function = "pipe.py:simulate"
[ports]
valve = { kind = "input", unit = "%", column = "valve_pct" }
q_in = { kind = "output", unit = "l/min"COLUMN }
"""
ODE = """
kind = "ode"
[ode]
function = "pipe.py:rates"
[ports]
power = { kind = "input"UNIT }
T = { kind = "state" }
"""
EQUATIONS = """
kind = "equations"
[equations]
"dw/dt" = "(motor - T)/J"
"dT/dt" = "k*w"
[ports]
motor = { kind = "input", unit = "N m" }
w = { kind = "state", unit = "rad/s"COLUMN }
T = { kind = "state", unit = "N" }
[parameters]
J = 1.0
k = 1.0
"""


def drafted(folder: Path, table: dict[str, np.ndarray], *argv: str) -> pd.DataFrame:
    """Run init and read the log with what it wrote."""
    pd.DataFrame(table).to_csv(folder / "log.csv", index=False)
    log, out = str(folder / "log.csv"), folder / "setup"
    assert main(["init", log, *argv, "--yes", "--force", "--quiet", "--out", str(out)]) == 0
    page = Path(argv[1]) if argv[0] == "--sim" and argv[1].endswith(".toml") else out / "sim.toml"
    mapping = out / "columns.toml" if (out / "columns.toml").exists() else None
    return read_log(log, mapping, nan="keep", simulator=read_simulator(page, trust=True))


def page(folder: Path, text: str, code: str = "") -> str:
    (folder / "pipe.py").write_text(code or "def simulate(t, u, p, x0): return [u.valve]\ndef rates(t, x, u, p): ...\n")
    (folder / "page.toml").write_text(text)
    return str(folder / "page.toml")


@pytest.mark.parametrize("column", ["", ', column = "q_in"'])
def test_the_last_word_of_a_ports_own_name_is_no_unit(column: str, tmp_path: Path) -> None:
    table = {"time": T, "valve_pct": 50 + 40 * np.sin(T), "q_in": 90 + 20 * np.sin(T)}
    read = drafted(tmp_path, table, "--sim", page(tmp_path, RUN.replace("COLUMN", column)))
    assert np.array_equal(read["q_in"], table["q_in"]) and np.array_equal(read.iloc[:, 2], table["valve_pct"])
    other = RUN.replace("COLUMN", column).replace("l/min", "mm").replace("q_in", "q_m")
    read = drafted(tmp_path, {k.replace("_in", "_m"): v for k, v in table.items()}, "--sim", page(tmp_path, other))
    assert np.array_equal(read["q_m"], table["q_in"])


def test_a_last_word_of_another_dimension_is_no_unit(tmp_path: Path) -> None:
    table = {"time": T, "valve_pct": 50 + 40 * np.sin(T), "flow_in": 90 + 20 * np.sin(T)}
    argv = ["--sim", page(tmp_path, RUN.replace("COLUMN", "")), "--signal", "q_in=flow_in"]
    assert np.array_equal(drafted(tmp_path, table, *argv)["q_in"], table["flow_in"])


def test_a_unit_that_is_made_of_others_is_that_of_the_port_or_stays(tmp_path: Path) -> None:
    table = {"time": T, "valve_pct": 50 + 40 * np.sin(T), "q_in [L/min]": 90 + 20 * np.sin(T)}
    sim = page(tmp_path, RUN.replace("COLUMN", "").replace("l/min", "m3/min"))
    assert drafted(tmp_path, table, "--sim", sim)["q_in"].to_numpy() == pytest.approx(1e-3 * table["q_in [L/min]"])
    table = {"time": T, "power [kJ/s]": 50 + 40 * np.sin(T), "T": np.sin(T)}
    read = drafted(tmp_path, table, "--sim", page(tmp_path, ODE.replace("UNIT", "")))
    assert np.array_equal(read["power"], table["power [kJ/s]"])


def test_a_column_that_the_page_names_is_converted_to_its_port(tmp_path: Path) -> None:
    table = {"time": T, "motor": np.cos(T), "w_motor_rpm": 30 * np.sin(T), "T": np.sin(T)}
    read = drafted(tmp_path, table, "--sim", page(tmp_path, EQUATIONS.replace("COLUMN", ', column = "w_motor_rpm"')))
    assert read["w_motor_rpm"].to_numpy() == pytest.approx(np.pi * np.sin(T))
    assert "ASSUMED: in rpm, as its header says" in (tmp_path / "setup" / "columns.toml").read_text()


@pytest.mark.parametrize(("unit", "factor"), [("", 1.0), (', unit = "%"', 1.0), (', unit = "1"', 0.01)])
@pytest.mark.parametrize("header", ["power [%]", "power_pct"])
def test_a_port_without_a_unit_gets_its_column_as_it_stands(
    unit: str, factor: float, header: str, tmp_path: Path
) -> None:
    table = {"time": T, header: 50 + 40 * np.sin(T), "T [degC]": 20 + np.sin(T)}
    sim = page(tmp_path, ODE.replace("UNIT", unit))
    read = drafted(tmp_path, table, "--sim", sim)
    assert read["power"].to_numpy() == pytest.approx(factor * table[header])
    assert np.array_equal(read["T"], table["T [degC]"])
    assert "in degC, as in the log" in (tmp_path / "setup" / "columns.toml").read_text()
    if header == "power [%]":  # without a mapping, the same
        plain = read_log(tmp_path / "log.csv", simulator=read_simulator(sim, trust=True))
        assert np.array_equal(plain["T"], read["T"]) and plain["power"].to_numpy() == pytest.approx(read["power"])


def test_names_of_equations_that_end_in_a_unit_are_in_it(tmp_path: Path) -> None:
    table = {"time": T, "power_pct": 50 + 40 * np.sin(T), "biomass_g_L": 3 + np.sin(T), "T_degC": 20 + np.sin(T)}
    argv = ["--equation", "dbiomass_g_L/dt = k*power_pct - biomass_g_L", "--equation", "T_degC = power_pct"]
    read = drafted(tmp_path, table, *argv, "--set", "k=0.02")
    assert all(np.array_equal(read[name], table[name]) for name in table)
    made = read_simulator(tmp_path / "setup" / "sim.toml")
    assert [made.port(name).unit for name in list(table)[1:]] == ["%", "g/L", "degC"]


def test_units_of_a_fmu(tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    from pamid.export.ode_fmu import ode_fmu

    made = ode_fmu(
        "heater", lambda t, x, u, p: [u.power - x.T], {"T": 0.0}, {"power": 0.0}, {},
        outputs=lambda t, x, u, p: {"T_room": x.T}, units={"power": "%"},
    )  # fmt: skip
    (tmp_path / "heater.fmu").write_bytes(made)
    table = {"time": T, "power_pct": 50 + 40 * np.sin(T), "T_room [degC]": 20 + np.sin(T)}
    read = drafted(tmp_path, table, "--sim", str(tmp_path / "heater.fmu"))
    assert np.array_equal(read["power"], table["power_pct"])
    assert np.array_equal(read["T_room"], table["T_room [degC]"])


ROOM = """import control
room = control.ss([[-1.2e-3, 1e-3], [5e-5, -6e-5]], [[1.5e-4], [0.0]], [[1, 0]], [[0]],
                  states=["air", "wall"], inputs=["heater"], outputs=["T_room"])
"""


@pytest.mark.parametrize(("count", "unit"), [(1.0, "s"), (1e3, "ms"), (1 / 60, "min")])
def test_a_slow_control_system_has_the_logs_clock_and_units(count: float, unit: str, tmp_path: Path) -> None:
    pytest.importorskip("control")
    (tmp_path / "room.py").write_text(ROOM)
    t, x, rows = 60.0 * np.arange(240), np.array([18.0, 17.0]), []
    heater = 40 + 30 * np.sign(np.sin(t / 1500))
    A = np.array([[-1.2e-3, 1e-3], [5e-5, -6e-5]])
    for u in heater:
        rows.append(x[0])
        for _ in range(6):
            x = x + 10.0 * (A @ x + np.array([1.5e-4, 0.0]) * u)
    table = {"time": count * t, "heater [%]": heater, "T_room [degC]": np.array(rows)}
    read = drafted(tmp_path, table, "--sim", f"{tmp_path / 'room.py'}:room", "--trust")
    assert read["time"].to_numpy() == pytest.approx(t)
    assert np.array_equal(read["heater"], heater) and np.array_equal(read["T_room"], table["T_room [degC]"])
    made = read_simulator(tmp_path / "setup" / "sim.toml", trust=True)
    assert [made.port(name).unit for name in ("heater", "T_room")] == ["%", "degC"]
    text = (tmp_path / "setup" / "columns.toml").read_text()
    assert f'unit = "{unit}" }}  # time; unit ASSUMED' in text
    assert text.count("as in the log") == 2


def test_the_only_column_left_in_a_unit_is_the_only_port_left_in_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Tension is a voltage in some languages; here it is the only one in newtons."""
    table = {"time": T, "motor_mNm": 1e3 * np.cos(T), "w": np.sin(T), "tension_N": 1 + np.sin(T)}
    sim = page(tmp_path, EQUATIONS.replace("COLUMN", ""))
    assert np.array_equal(drafted(tmp_path, table, "--sim", sim)["T"], table["tension_N"])
    assert "ASSUMED" in next(x for x in (tmp_path / "setup" / "columns.toml").read_text().splitlines() if x[:2] == "T ")
    assert "T" in drafted(tmp_path, {k.replace("tension", "speed"): x for k, x in table.items()}, "--sim", sim)
    two = {**table, "grip_N": 2 + np.sin(T)}
    assert "T" not in drafted(tmp_path, two, "--sim", sim)


@pytest.mark.parametrize("signal", ["w=speed_b", "speed_a=speed_b"])
def test_a_column_that_the_command_line_names_wins(
    signal: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = {"time": T, "motor": np.cos(T), "speed_a": 0 * T, "speed_b": np.sin(T), "T": np.sin(T)}
    sim = page(tmp_path, EQUATIONS.replace("COLUMN", ', column = "speed_a"'))
    read = drafted(tmp_path, table, "--sim", sim, "--signal", signal)
    assert np.array_equal(read["speed_a"], table["speed_b"])


def test_a_column_is_named_without_its_unit(tmp_path: Path) -> None:
    sim = page(tmp_path, EQUATIONS.replace("COLUMN", ', column = "speed_a"'))
    table = {"time": T, "motor": np.cos(T), "speed_a [rpm]": 0 * T, "speed_b [rpm]": np.sin(T), "T": np.sin(T)}
    read = drafted(tmp_path, table, "--sim", sim, "--signal", "w=speed_b")
    assert read["speed_a"].to_numpy() == pytest.approx(np.pi / 30 * table["speed_b [rpm]"])


def test_init_says_which_column_a_page_names_in_vain(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = {"time": T, "motor": np.cos(T), "w": np.sin(T), "T": np.sin(T)}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    sim = page(tmp_path, EQUATIONS.replace("COLUMN", ', column = "W"'))
    argv = ["init", str(tmp_path / "log.csv"), "--sim", sim, "--yes", "--json", "--out", str(tmp_path / "setup")]
    assert main(argv) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["assumed"]["signals"]["W"] == "ASSUMED: the log lacks W, which the simulator file names"

"""A simulator of your own gets its signals in the units that its ports name, whatever the log's are."""

import json

import numpy as np
import pandas as pd
import pytest

from pamid import evaluate, read_simulator
from pamid.cli import main
from pamid.signals import LogMapping, read_log

PAGE = """kind = "ode"
[ode]
function = "room.py:rates"
[ports]
heat = {{ kind = "input", unit = "kW" }}
outside = {{ kind = "input", unit = "{unit}" }}
T = {{ kind = "state", unit = "{unit}" }}
level = {{ kind = "state", unit = "cm" }}
[parameters]
C = {{ value = 60.0, tolerance = 0.05, unit = "kJ/K" }}
"""
CODE = """def rates(t, x, u, p):
    return [(u.heat - 0.05 * (x.T - u.outside)) / p.C, 0.1 * u.heat - 0.01 * x.level]
"""


@pytest.fixture
def folder(tmp_path):
    rng, t, T, level, rows = np.random.default_rng(0), np.arange(0.0, 1500.0), 18.0, 9.0, []
    heat, outside = 1.0 + 0.8 * np.sin(t / 90), 8.0 + 2.0 * np.sin(t / 400)
    for h, o in zip(heat, outside, strict=True):
        rows.append((T, level))
        for _ in range(4):
            T, level = T + 0.25 * (h - 0.05 * (T - o)) / 60.0, level + 0.25 * (0.1 * h - 0.01 * level)
    T, level = np.array(rows).T + np.array([[0.01], [0.005]]) * rng.standard_normal((2, len(t)))
    table = {"t [s]": t, "heater [W]": 1e3 * heat, "outside [°C]": outside, "room [°C]": T, "level [mm]": 10.0 * level}
    pd.DataFrame(table).to_csv(tmp_path / "room.csv", index=False)
    (tmp_path / "room.py").write_text(CODE)
    return tmp_path


@pytest.mark.parametrize("unit", ["degC", "K"])
def test_signals_come_in_the_units_of_their_ports(folder, unit, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "room.toml").write_text(PAGE.format(unit=unit))
    names = {"heat": "heater [W]", "outside": "outside [°C]", "T": "room [°C]", "level": "level [mm]"}
    signals = [word for name, column in names.items() for word in ("--signal", f"{name}={column}")]
    assert main(["init", "room.csv", "--sim", "room.toml", "--trust", "--yes", *signals, "--out", "setup"]) == 0
    told = capsys.readouterr().out.splitlines()
    shown = {line.split()[0]: line.split()[1:] for line in told[told.index("") + 2 :] if len(line.split()) == 4}
    assert float(shown["heat"][0]) == pytest.approx(0.2, abs=1e-3) and shown["heat"][2] == "kW"
    assert float(shown["T"][1]) == pytest.approx(T_TOP[unit], abs=6.0) and shown["T"][2] == unit
    assert 5.0 < float(shown["level"][1]) < 25.0
    common = ["room.csv", "--columns", "setup/columns.toml", "--sim", "room.toml"]
    assert main(["evaluate", *common, "--trust", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert all(e["rmse"] < 1.5 * e["noise_floor"] for e in found["equations"].values()), found
    assert main(["check", *common]) == 0
    told = capsys.readouterr().out
    assert "looks like" not in told and any(line.split()[:2] == ["T", unit] for line in told.splitlines())
    simulator = read_simulator(folder / "room.toml", trust=True)
    log = read_log("room.csv", "setup/columns.toml", nan="keep", simulator=simulator)
    errors = {name: e.rmse for name, e in evaluate(log, simulator).items()}
    assert errors == {name: e["rmse"] for name, e in found["equations"].items()}


T_TOP = {"degC": 25.0, "K": 298.0}


def test_a_unit_that_is_the_ports_own_leaves_every_bit(folder):
    mapping = {"signals": {"time": "t [s]", "T": {"column": "room [°C]", "unit": "degC"}, "level": "level [mm]"}}
    own = {"T": "°C", "level": "cm", "heat": "W", "none": "-", "odd": "m^2.5/s"}
    raw = pd.read_csv(folder / "room.csv")
    log = read_log(folder / "room.csv", LogMapping.load(mapping, own), check_units=False)
    assert np.array_equal(log["T"], raw["room [°C]"])
    assert np.array_equal(log["level"], raw["level [mm]"])  # without a unit, it is as the log has it


def test_units_that_are_made_of_others_are_read_in_si(tmp_path, capsys):
    t = np.arange(0.0, 60.0, 0.1)
    table = {"t [min]": t, "feed [kmol/min]": 1.2 + 0.3 * np.sin(t), "out [furlong]": np.cos(t), "n [mol]": 50.0 + t}
    pd.DataFrame(table).to_csv(tmp_path / "tank.csv", index=False)
    said = ["--signal", "feed=feed [kmol/min]", "--signal", "out=out [furlong]", "--signal", "n=n [mol]"]
    equation = ["--equation", "dn/dt = feed - out - n/tau", "--set", "tau=60 s"]
    log, out = str(tmp_path / "tank.csv"), str(tmp_path / "setup")
    assert main(["init", log, *equation, *said, "--yes", "--out", out]) == 0
    told = capsys.readouterr().out
    assert "'furlong' is not a known unit" in told and "'kmol/min'" not in told and "'mol'" not in told
    page = (tmp_path / "setup" / "sim.toml").read_text()
    assert 'feed = { kind = "input", unit = "mol/s" }' in page and 'n = { kind = "state", unit = "mol" }' in page
    read = read_log(log, tmp_path / "setup" / "columns.toml", check_units=False)
    assert read["feed"].iloc[0] == pytest.approx(20.0) and read["n"].iloc[0] == 50.0


def test_litres_and_what_stands_before_a_slash_belong_to_the_unit(tmp_path, capsys):
    t = np.arange(0.0, 60.0, 0.1)
    table = {"t [s]": t, "volume (L)": 2.0 + 0.01 * t, "feed [mL/s]": 10.0 + 0.0 * t, "sun W/m2": 500.0 + t}
    pd.DataFrame(table).to_csv(tmp_path / "tank.csv", index=False)
    said = ["--signal", "V=volume (L)", "--signal", "F=feed [mL/s]", "--signal", "sun=sun W/m2"]
    equation = ["--equation", "dV/dt = F - k*sun*V", "--set", "k=0 m2/J"]
    log, out = str(tmp_path / "tank.csv"), str(tmp_path / "setup")
    assert main(["init", log, *equation, *said, "--yes", "--out", out]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["V", "0.002", "0.002599", "m^3"] in rows and ["sun", "500", "559.9", "W/m2"] in rows

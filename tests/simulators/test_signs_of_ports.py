"""Columns of the opposite sign, in each other's place, off by a factor or beyond a joint's stops: told before a fit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from pamid import read_log
from pamid.cli import main
from pamid.simulators import EquationSimulator, Port, page_text
from pamid.simulators.port_log import port_log
from pamid.simulators.port_units import unit_doubts


def cart() -> EquationSimulator:
    ports = [Port("u", "input", "V"), Port("x", "state", "m"), Port("v", "state", "m/s")]
    return EquationSimulator({"dx/dt": "v", "dv/dt": "2*u - 3*v - 4*x"}, ports, {})


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    """Return a cart with dry friction, which its simulator lacks."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 12.0, 0.01)
    u, x, v, rows = 3.0 * np.sin(1.7 * t) + 2.0 * np.sin(4.1 * t), 0.0, 0.0, []
    for now in u:
        rows.append((x, v))
        for _ in range(10):
            v += 1e-3 * (2.0 * now - 3.0 * v - 4.0 * x - 0.3 * np.tanh(v / 0.01))
            x += 1e-3 * v
    found = np.array(rows) + [1e-4, 1e-3] * rng.standard_normal((len(t), 2))
    return pd.DataFrame({"trajectory": "run", "time": t, "u": u, "x": found[:, 0], "v": found[:, 1]})


CHANGES: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "nothing": (lambda d: d, ""),
    "a gain that the library tests": (lambda d: d.assign(v=1.4 * d["v"]), ""),
    "input": (lambda d: d.assign(u=-d["u"]), "u seems to have the opposite sign"),
    "speed": (lambda d: d.assign(v=-d["v"]), "x or v seems to have the opposite sign"),
    "exchanged": (lambda d: d.rename(columns={"x": "v", "v": "x"}), "x and v seem to be exchanged"),
    "factor": (lambda d: d.assign(x=1.7 * d["x"]), "x changes 1.7"),
    "millimetres": (lambda d: d.assign(x=1e3 * d["x"]), ": x may be in mm (pamid init --signal 'x=COLUMN:mm')"),
    "feet a second": (
        lambda d: d.assign(v=d["v"] / 0.3048),
        ": v may be in ft/s (pamid init --signal 'v=COLUMN:ft/s')",
    ),
    "millivolts": (lambda d: d.assign(u=1e3 * d["u"]), ": u may be in mV (pamid init --signal 'u=COLUMN:mV')"),
    "counts of a converter": (
        lambda d: d.assign(x=(3276.8 * d["x"]).round()),
        "x, in whole numbers, may be counts of a converter (pamid init --signal 'x=COLUMN*0.000305')",
    ),
    "a scale of a converter": (
        lambda d: d.assign(x=0.61 * d["x"]),
        "(pamid init --signal 'x=COLUMN*1.64' or pamid init --signal 'v=COLUMN*0.61' converts it)",
    ),
    "a drive of a third": (lambda d: d.assign(u=d["u"] / 7.0), "(pamid init --signal 'u=COLUMN*6"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_what_contradicts_the_motion_is_told(log: pd.DataFrame, what: str) -> None:
    change, said = CHANGES[what]
    doubts = unit_doubts(cart(), port_log(change(log), cart()))
    assert (said in "; ".join(doubts)) if said else doubts == []


@pytest.fixture(scope="module")
def tanks() -> pd.DataFrame:
    """Return a log of two tanks, each with a pump of its own."""
    t = np.arange(0.0, 10.0, 0.01)
    a, b = np.sin(1.3 * t) + 0.5 * np.sin(4 * t), np.cos(2.1 * t) + 0.4 * np.sin(5 * t)
    x = np.zeros((len(t), 2))
    for k in range(len(t) - 1):
        x[k + 1] = x[k] + 0.01 * (np.array([2.0 * a[k], 5.0 * b[k]]) - np.array([3.0, 1.0]) * x[k])
    x += 1e-4 * np.random.default_rng(0).standard_normal(x.shape)
    return pd.DataFrame({"trajectory": "r", "time": t, "a": a, "b": b, "x": x[:, 0], "y": x[:, 1]})


@pytest.mark.parametrize(("units", "told"), [(("V", "V"), True), (("V", "A"), False)])
def test_exchanged_commands_are_told_where_their_unit_is_one(
    tanks: pd.DataFrame, units: tuple[str, str], told: bool
) -> None:
    ports = [
        Port("a", "input", units[0]),
        Port("b", "input", units[1]),
        Port("x", "state", "m"),
        Port("y", "state", "m"),
    ]
    simulator = EquationSimulator({"dx/dt": "2*a - 3*x", "dy/dt": "5*b - y"}, ports, {})
    assert unit_doubts(simulator, port_log(tanks, simulator)) == []
    swapped = tanks.assign(a=tanks["b"], b=tanks["a"])
    assert (
        any("a and b seem to be exchanged" in d for d in unit_doubts(simulator, port_log(swapped, simulator))) is told
    )


def test_readings_far_beyond_the_stops_of_a_joint_are_told(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    from pamid.simulators import MujocoSimulator

    xml = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body>
    <joint name="hip" axis="0 1 0" range="-2.2 2.2"/><geom size="0.1" pos="0 0 -.2"/></body></worldbody>
    <actuator><motor name="m" joint="hip"/></actuator></mujoco>"""
    (tmp_path / "leg.xml").write_text(xml)
    simulator, t = MujocoSimulator(tmp_path / "leg.xml"), np.arange(0.0, 4.0, 0.01)
    table = pd.DataFrame({"trajectory": "run", "time": t, "m": 0.0, "hip_q": 0.55 * np.sin(t)})
    assert unit_doubts(simulator, port_log(table, simulator)) == []
    (doubt,) = unit_doubts(simulator, port_log(table.assign(hip_q=np.degrees(table["hip_q"])), simulator))
    assert "to 31.5, but its stops allow -2.2 to 2.2 rad: it may be in degrees" in doubt


def test_a_command_that_a_limit_cuts_is_no_mistake(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    from pamid.simulators import MujocoSimulator

    xml = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body>
    <joint name="hip" axis="0 1 0"/><geom size="0.1" pos="0 0 -.2"/></body></worldbody>
    <actuator><motor name="m" joint="hip" ctrlrange="-6 6"/><position name="s" joint="hip" ctrlrange="-1 1"/></actuator>
    </mujoco>"""
    (tmp_path / "leg.xml").write_text(xml)
    simulator, t = MujocoSimulator(tmp_path / "leg.xml"), np.arange(0.0, 4.0, 0.01)
    table = pd.DataFrame({"trajectory": "run", "time": t, "m": 25 * np.sin(t), "s": np.sin(t), "hip_q": 0.0 * t})
    assert unit_doubts(simulator, port_log(table, simulator)) == []
    (doubt,) = unit_doubts(simulator, port_log(table.assign(s=np.degrees(table["s"])), simulator))
    assert "it may be in degrees" in doubt


@pytest.mark.parametrize("what", ["speed", "millimetres"])
def test_check_tells_it(log: pd.DataFrame, tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    (tmp_path / "cart.toml").write_text(page_text(cart(), tmp_path))
    change, said = CHANGES[what]
    change(log).to_csv(tmp_path / "log.csv", index=False)
    assert main(["check", str(tmp_path / "log.csv"), "--sim", str(tmp_path / "cart.toml")]) == 0
    assert said in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("clock", ["fs", "stamps", "period"])
def test_a_speed_is_in_its_unit_whatever_counts_the_time(log: pd.DataFrame, tmp_path: Path, clock: str) -> None:
    (tmp_path / "cart.toml").write_text(page_text(cart(), tmp_path))
    table, more = log[["u", "x", "v"]], []
    path = tmp_path / ("log.mat" if clock == "fs" else "log.csv")
    if clock == "fs":
        savemat(path, {name: table[name].to_numpy() for name in table} | {"fs": 100.0})
    elif clock == "stamps":
        table.assign(stamp=pd.Timestamp("2026-01-01") + pd.to_timedelta(log["time"], unit="s")).to_csv(
            path, index=False
        )
    else:
        table.to_csv(path, index=False)
        more = ["--constant", "sampling_period=10 ms"]
    out = tmp_path / "setup"
    assert main(["init", str(path), "--sim", str(tmp_path / "cart.toml"), "--yes", "--out", str(out), *more]) == 0
    (line,) = (text for text in (out / "columns.toml").read_text().splitlines() if text.startswith("v = "))
    assert "cm" not in line and "DOUBTFUL" not in line
    read = read_log(path, out / "columns.toml")
    assert float(read["time"].iloc[1]) == pytest.approx(0.01)

"""Systems beside the bench: their pages, their nominal equations, and a diagnosis of each."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from pamid import diagnose
from pamid.bench import BenchParameters, isometric, simulate, sine, unfold
from pamid.cli import main
from pamid.errors import (
    ImplausibleParameterError,
    MissingColumnError,
    MissingParameterError,
    SimulatorFileError,
    UnknownOptionError,
    UnknownParameterError,
)
from pamid.report import GapDisplay, report_html
from pamid.signals import read_log, write_log
from pamid.simulators import Port, Simulator
from pamid.systems import all_systems, read_system
from pamid.systems.cylinder import Cylinder
from pamid.systems.joint import Joint
from pamid.systems.muscle import Muscle

TIME = np.arange(0, 6, 0.01)


def runs(make) -> pd.DataFrame:
    parts = [make(w).assign(trajectory=f"sine-{w:g}", time=TIME) for w in (1.0, 2.0, 3.5)]
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def stroke() -> pd.DataFrame:
    rng = np.random.default_rng(0)

    def run(w: float) -> pd.DataFrame:
        P = 4e5 + 50.0 * rng.standard_normal(len(TIME))
        friction = 8.0 * np.tanh(np.cos(w * TIME) / 0.02)
        F = (P - 101_325.0) * np.pi / 4 * 0.025**2 + friction + 0.1 * rng.standard_normal(len(TIME))
        return pd.DataFrame({"x": 0.02 + 0.015 * np.sin(w * TIME), "P": P, "F": F})

    return runs(run)


@pytest.mark.parametrize("kind", all_systems())
def test_a_page_is_read_back(kind, tmp_path):
    cls = all_systems()[kind]
    given = {q.name: 0.5 * (q.lower + min(q.upper, 2.0)) for q in cls.quantities if q.default is None}
    (tmp_path / "sim.toml").write_text(cls.text(given, tuple(given)), encoding="utf-8")
    again = read_system(tmp_path / "sim.toml")
    assert type(again) is cls
    for name, value in cls(**given).values.items():
        assert again.values[name] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-5))
    text = (tmp_path / "sim.toml").read_text()
    assert text.count("ASSUMED") == len(given)
    assert all(q.meaning in text for q in cls.quantities)


def test_units_in_a_page():
    assert Cylinder(bore="25 mm").values["bore"] == pytest.approx(0.025)
    assert Joint(inertia=0.2).values["gravity"] == "fit"


@pytest.mark.parametrize(
    ("cls", "values", "error", "words"),
    [
        (Cylinder, {}, MissingParameterError, "lacks bore"),
        (Cylinder, {"bore": 25}, ImplausibleParameterError, "25 mm is 0.025"),
        (Cylinder, {"bore": "25 kg"}, ImplausibleParameterError, "a mass"),
        (Cylinder, {"bore": 0.025, "stroke": 1}, UnknownParameterError, "'stroke'"),
        (Muscle, {"rest_length": 0.2, "rest_diameter": "fit"}, ValueError, "fit"),
    ],
)
def test_a_wrong_number_is_explained(cls, values, error, words):
    with pytest.raises(error, match=words):
        cls(**values)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("kind = ", SimulatorFileError),
        ('kind = "sofa"', UnknownOptionError),
        ('kind = "cylinder"\n[cylinder]\nbore = 0.02\n[other]', UnknownParameterError),
        ('kind = "cylinder"\ncylinder = 3', SimulatorFileError),
        (None, FileNotFoundError),
    ],
)
def test_a_page_that_cannot_be_read(text, error, tmp_path):
    if text is not None:
        (tmp_path / "sim.toml").write_text(text)
    with pytest.raises(error):
        read_system(tmp_path / "sim.toml")


def test_a_log_without_a_signal(stroke):
    with pytest.raises(MissingColumnError, match="stroke"):
        Cylinder(bore=0.025).problem(stroke.drop(columns="x"))
    with pytest.raises(MissingColumnError, match="neither drive nor q_ref"):
        Joint().problem(stroke.rename(columns={"x": "q"}))
    with pytest.raises(MissingParameterError, match="gain"):
        Joint().problem(stroke.rename(columns={"x": "q", "F": "q_ref"}))


def test_the_friction_of_a_cylinder_is_named(stroke):
    found = diagnose(stroke, Cylinder(bore=0.025), ["coulomb_friction", "force_bias"])
    assert found.verdict == "cause"
    assert found.causes[0].effects == ("coulomb_friction",)
    assert found.closure[0].unit == "N"
    assert {"x", "dx", "P"} <= set(found.windows.columns)
    labels = [ax.get_xlabel() for ax in GapDisplay(found).plot("map").axes_] + [
        ax.get_xlabel() for ax in GapDisplay(found).plot("loop").axes_
    ]
    assert "stroke / mm" in labels
    assert not any("contraction" in label for label in labels)


def test_a_servo_with_a_proportional_controller():
    rng = np.random.default_rng(1)

    def run(w: float) -> pd.DataFrame:
        q, dq, ddq = 0.5 * np.sin(w * TIME), 0.5 * w * np.cos(w * TIME), -0.5 * w * w * np.sin(w * TIME)
        drive = 0.1 * ddq + 3.0 * np.sin(q) + 0.6 * np.tanh(dq / 0.02) + 0.02 * rng.standard_normal(len(TIME))
        return pd.DataFrame({"q": q, "q_ref": q + drive / (0.5 * 7.4), "voltage": 7.4})

    log, system = runs(run), Joint(gain=0.5, limit=0.0)
    problem = system.problem(log)
    values = {
        w.split(" ")[0]: float(w.split(" ")[1]) for w in problem.notes[0].split(": ")[1].split("; ")[0].split(", ")
    }
    assert values["inertia"] == pytest.approx(0.1, abs=0.02)
    assert values["gravity"] == pytest.approx(3.0, abs=0.1)
    found = diagnose(log, system, ["coulomb_friction", "viscous_friction"])
    assert found.causes[0].effects == ("coulomb_friction",)
    assert found.windows.columns.is_unique
    assert "joint angle / deg" in [ax.get_xlabel() for ax in GapDisplay(found).plot("loop").axes_]
    assert "joint angle" in report_html(found)
    assert found.corrected.number("inertia") == pytest.approx(0.1, abs=0.02)  # the page that closes the gap is whole
    limited = Joint(gain=0.5, limit=0.2).problem(log)
    assert len(limited.y) < len(log)
    assert any("left out" in note for note in limited.notes)


@pytest.mark.parametrize("noise", [2e-4, 6e-4])  # rad
def test_the_noise_of_an_angle_is_no_gap_of_a_joint(noise):
    """An acceleration is taken over many rows: they share its noise, which neighbours do not show."""
    exact, rng = Joint(inertia=0.03, gravity=0.5, level=0.0, offset=0.0), np.random.default_rng(0)
    runs = [
        pd.DataFrame({"trajectory": str(k), "time": TIME, "q": 0.8 * np.sin((3 + k) * TIME + k), "drive": 0.0})
        for k in range(4)
    ]
    log = pd.concat(runs, ignore_index=True)
    problem = exact.problem(log)
    log = log.loc[problem.X.index].assign(drive=problem.nominal(problem.X) + 2e-3 * rng.standard_normal(len(problem.X)))
    log["q"] += noise * rng.standard_normal(len(log))
    found = diagnose(log.reset_index(drop=True), exact)
    assert found.verdict == "none", found


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_the_loss_of_a_gear_is_a_share_in_any_unit_of_the_drive(unit):
    rng = np.random.default_rng(0)

    def run(w: float) -> pd.DataFrame:
        q, way = 0.5 * np.sin(w * TIME), np.tanh(50.0 * w * np.cos(w * TIME))
        load = 0.8 * np.sin(q) - 0.02 * w**2 * q
        drive = load + 0.15 * np.abs(load) * way + 0.002 * rng.standard_normal(len(TIME))
        return pd.DataFrame({"q": q, "drive": unit * drive})

    joint = Joint(inertia=0.02 * unit, gravity=0.8 * unit, unit="N m")
    found = diagnose(runs(run), joint, ["torque_loss", "viscous_friction", "coulomb_friction"])
    assert [c.effects for c in found.causes] == [("torque_loss",)]
    shares = found.causes[0].parameters
    assert [shares[n].value for n in ("driving", "driven")] == pytest.approx([0.15, 0.15], abs=0.01)


def test_a_single_muscle_agrees_with_the_twin():
    bench = BenchParameters.for_muscle("B")
    log = unfold(simulate(bench, [sine(4, 15, samples=500), isometric(5, 5e4, samples=500)], seed=0), bench)
    geometry = Muscle(rest_length=0.2, rest_diameter=0.02)
    for drop, unit in (("mdot", "N"), ("F", "kg/s")):
        problem = geometry.problem(log.drop(columns=drop))
        assert problem.unit == unit
        gap = problem.y - problem.nominal(problem.X)
        assert np.std(gap) < (0.02 if unit == "N" else 0.3) * np.std(problem.y)
    with pytest.raises(MissingColumnError, match="neither F nor mdot"):
        geometry.problem(log.drop(columns=["F", "mdot"]))


def test_the_command_takes_the_page_of_a_system(stroke, tmp_path, capsys):
    write_log(stroke, tmp_path / "log.parquet")
    (tmp_path / "sim.toml").write_text('kind = "cylinder"\n[cylinder]\nbore = "25 mm"\n')
    argv = [str(tmp_path / "log.parquet"), "--sim", str(tmp_path / "sim.toml")]
    library = ["--effects", "coulomb_friction,force_bias"]
    assert main(["diagnose", *argv, "--out", str(tmp_path / "out"), *library, "--json", "--quiet"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["causes"][0]["effects"] == ["coulomb_friction"]
    written = ["corrected.toml", "diagnosis.json", "logs.parquet", "report.html", "state.json"]
    assert sorted(report["files"]) == sorted(p.name for p in (tmp_path / "out").iterdir()) == written


def test_a_condition_leaves_rows_out(stroke, tmp_path, capsys):
    spring = 3e3 * np.maximum(stroke["x"] - 0.028, 0.0)  # what the end of the stroke adds is not asked about
    write_log(stroke.assign(F=stroke["F"] + spring), tmp_path / "log.parquet")
    Cylinder(bore=0.025).to_toml(tmp_path / "sim.toml")
    words = ["diagnose", str(tmp_path / "log.parquet"), "--sim", str(tmp_path / "sim.toml"), "--quiet", "--json"]
    words += ["--effects", "coulomb_friction,viscous_friction", "--out", str(tmp_path / "found")]
    assert main([*words, "--where", "x < 0.028"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [c["effects"] for c in found["causes"]] == [["coulomb_friction"]]
    assert found["closure"][0]["rmse_after"] < 1.0
    assert any("Only rows that meet the condition are used: 6" in text for text in found["notes"])
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["closure"][0]["rmse_after"] > 3.0
    assert main([*words, "--where", "x > 1"]) == 2
    assert "No row meets" in capsys.readouterr().err


def test_readings_of_rows_that_miss_a_condition(stroke):
    rows = stroke["x"] < 0.028
    kept = BenchParameters.for_muscle("B").where(stroke, rows)
    assert (kept["F"].isna() == (stroke["x"] >= 0.028)).all()
    assert kept["x"].notna().all()
    with pytest.raises(MissingColumnError, match="none of mdot"):
        Simulator([Port("mdot", "output")]).where(stroke, rows)


def test_numbers_beside_the_entries_of_a_json_log_become_signals(tmp_path):
    entries = [{"t": 0.01 * k, "q": 0.1 * k} for k in range(5)]
    (tmp_path / "log.json").write_text(json.dumps({"kp": 4, "entries": entries}))
    mapping = {"time": {"column": "t"}, "q": {"column": "q"}, "gain": {"column": "kp", "scale": 0.5}}
    assert read_log(tmp_path / "log.json", mapping)["gain"].tolist() == [2.0] * 5

"""Several logs, days, changes and further logs, with any simulator: in Python and on the command line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.cli import main
from pamid.effects import all_effects
from pamid.errors import IncompatibleError, LogFormatError, ParameterError, UnknownOptionError, UntrustedCodeError
from pamid.gap import diagnose_simulator
from pamid.gap.diagnosis.findings import Cause, ParameterEstimate
from pamid.gap.several import Conditions, read_conditions, read_history
from pamid.gap.several.compare import _causes
from pamid.gap.several.variants import Variants
from pamid.simulators import FunctionSimulator, Port
from pamid.systems.cylinder import Cylinder

MASS = 2.0
PORTS = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
RAIL = FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m], PORTS, {"m": (MASS, 0.05, "kg")})
LIBRARY = ["viscous_friction", "coulomb_friction", "actuator_gain", "quadratic_drag"]
PAGE = """kind = "ode"
[ode]
function = "rail.py:rate"
[ports]
F = { kind = "input", unit = "N" }
x = { kind = "state", unit = "m" }
v = { kind = "state", unit = "m/s" }
[parameters]
m = { value = 2.0, tolerance = 0.05, unit = "kg" }
"""
CODE = "def rate(t, x, u, p):\n    return [x.v, u.F / p.m]\n"


def recorded(seed: int, viscous: float = 3.0, dry: float = 0.0, mass: float = MASS, runs: int = 2) -> pd.DataFrame:
    """A mass on a rail, pushed to and fro, finely integrated."""
    rng, found = np.random.default_rng(seed), []
    for k in range(runs):
        t, x, v = np.arange(0, 6, 0.01), [0.0], [0.0]
        force = 5.0 * np.sin((1.0 + k + 0.3 * seed) * t) + 3.0 * np.sin(0.7 * t)
        for f in force[:-1]:
            now = v[-1]
            for _ in range(10):
                now += 0.001 * (f - viscous * now - dry * np.tanh(now / 1e-3)) / mass
            v.append(now)
            x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
        noisy = {"x": x + 1e-5 * rng.standard_normal(len(t)), "v": v + 1e-3 * rng.standard_normal(len(t))}
        found.append(pd.DataFrame({"trajectory": f"{k}", "time": t, "F": force, **noisy}))
    return pd.concat(found, ignore_index=True)


@pytest.fixture(scope="module")
def days() -> dict[str, pd.DataFrame]:
    return {"monday": recorded(1), "friday": recorded(2, dry=1.0)}


def test_logs_in_a_list_are_taken_like_logs_by_name(days: dict[str, pd.DataFrame], monkeypatch) -> None:
    given: dict[str, pd.DataFrame] = {}
    monkeypatch.setattr("pamid.any_simulator.go_on", lambda history, logs, **_: given.update(logs))
    pamid.diagnose(list(days.values()), RAIL)
    assert list(given) == ["log", "log 2"]
    assert given["log 2"] is days["friday"]
    short = {name: log[:300] for name, log in days.items()}
    by_name, in_a_list = (pamid.evaluate(logs, RAIL) for logs in (short, list(short.values())))
    assert dict(by_name) == dict(in_a_list)
    for call in (pamid.diagnose, pamid.evaluate):
        with pytest.raises(ParameterError, match=r"'log' is a str.*Read a file with read_log"):
            call("monday.csv", RAIL)


@pytest.fixture(scope="module")
def changed(days):
    return diagnose_simulator(days, RAIL, LIBRARY)


def test_a_cause_that_appears_between_two_days_is_told_with_its_size(changed) -> None:
    assert [c.effects[0] for c in changed.causes] == ["viscous_friction", "coulomb_friction"]
    (change,) = changed.changes
    assert (change.effect, change.where, change.how, change.log) == ("coulomb_friction", "x", "appears", "friday")
    assert change.after == pytest.approx(1.0, rel=0.05) and change.unit == "N"
    monday, friday = changed.logs
    assert monday.parameters.keys() == {"viscous_friction@x"}
    assert friday.parameters["coulomb_friction@x"]["amplitude"].value == pytest.approx(1.0, rel=0.05)
    assert friday.parameters["viscous_friction@x"]["coefficient"].unit == "N s/m"
    assert {name for name, _, _ in changed.corrected.effects} == {"viscous_friction", "coulomb_friction"}


def test_a_cause_that_stays_is_one_cause_with_the_size_of_both_logs() -> None:
    found = diagnose_simulator({"a": recorded(1), "b": recorded(2)}, RAIL, LIBRARY)
    assert found.verdict == "cause" and not found.changes
    assert found.causes[0].parameters["coefficient"].value == pytest.approx(3.0, rel=0.02)


def test_no_gap_in_several_logs() -> None:
    found = diagnose_simulator({"a": recorded(1, viscous=0.0), "b": recorded(2, viscous=0.0)}, RAIL, LIBRARY)
    assert found.verdict == "none" and [f.log for f in found.logs] == ["a", "b"]


def test_conditions_are_parameters_of_the_simulator(tmp_path: Path) -> None:
    logs = {"light": recorded(1, viscous=0.0), "heavy": recorded(2, viscous=0.0, mass=3.0)}
    table = tmp_path / "conditions.csv"
    table.write_text("log,day,m\nlight,1,\nheavy,1,3.0\n")
    held = read_conditions(table, RAIL)
    assert held["heavy"] == Conditions({"m": 3.0}, "1")
    assert diagnose_simulator(logs, RAIL, LIBRARY, conditions=held).verdict == "none"
    assert diagnose_simulator(logs, RAIL, LIBRARY).verdict != "none"
    table.write_text("log,day,m\nlight,1,3 kg\n")
    with pytest.raises(ParameterError, match="a number in the unit of the simulator's parameter"):
        read_conditions(table, RAIL)
    table.write_text("log,day,mass\nlight,1,\n")
    with pytest.raises(UnknownOptionError, match=r"mass.*not a simulator parameter"):
        read_conditions(table, RAIL)


def test_logs_of_other_signals_and_runs_that_come_twice_are_refused(days) -> None:
    with pytest.raises(IncompatibleError, match="sample by sample"):
        diagnose_simulator({"a": days["monday"], "b": days["monday"]}, RAIL, LIBRARY)


def test_one_way_for_every_simulator_in_python(days) -> None:
    first = pamid.diagnose(days["monday"], RAIL, LIBRARY)
    assert first.causes[0].effects == ("viscous_friction",) and not first.logs
    second = pamid.diagnose({"friday": days["friday"]}, RAIL, since=first.history)
    assert len(second.rounds) == 2 and second.changes[0].effect == "coulomb_friction"
    with pytest.raises(ParameterError, match="earlier diagnosis"):
        pamid.diagnose({"more": days["friday"]}, RAIL, ["viscous_friction"], since=first.history)
    found = pamid.evaluate(days["monday"], RAIL)
    assert found["x"].rmse > 10.0 * found["x"].noise_floor and found["x"].trajectories.keys() == {"0", "1"}
    pieces = [run for _, run in days["monday"].groupby("trajectory")]
    assert pamid.evaluate(pieces, RAIL)["x"].rmse == pytest.approx(found["x"].rmse, rel=0.01)


def stroked(seed: int, dry: float, half: float = 0.015) -> pd.DataFrame:
    """A cylinder of 25 mm with viscous friction of 60 N s/m and dry friction, moved by half a stroke either way."""
    rng, t, runs = np.random.default_rng(seed), np.arange(0.0, 6.0, 0.005), []
    for k, w in enumerate((1.0 + 0.05 * seed, 2.3, 3.7 - 0.05 * seed)):
        x, v, gauge = 0.02 + half * np.sin(w * t), half * w * np.cos(w * t), 2e5 + 8e4 * np.sin(0.7 * w * t + seed)
        force = 4.9087e-4 * gauge - 60.0 * v - dry * np.tanh(v / 1e-3) + 0.3 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"{k}", "time": t, "x": x, "P": 101_325.0 + gauge, "F": force}))
    return pd.concat(runs, ignore_index=True)


def test_what_changed_in_a_cylinder_between_two_days_is_told_with_its_size() -> None:
    library = ["viscous_friction", "coulomb_friction", "force_bias"]
    logs = {"monday": stroked(0, 0.0), "friday": stroked(1, 6.0, 0.007)}  # one coefficient, whatever the stroke
    found = pamid.diagnose(logs, Cylinder(bore=0.025), library)
    (change,) = found.changes
    assert (change.effect, change.how, change.log, change.unit) == ("coulomb_friction", "appears", "friday", "N")
    assert change.after == pytest.approx(6.0, rel=0.05)
    assert found.logs[0].parameters.keys() == {"viscous_friction"}
    assert found.logs[0].parameters["viscous_friction"]["coefficient"].value == pytest.approx(60.0, rel=0.05)
    assert {e.name for e in found.corrected.effects} == {"viscous_friction", "coulomb_friction"}


def test_a_cylinder_goes_on_from_an_earlier_log(tmp_path: Path) -> None:
    def run(seed: int) -> pd.DataFrame:
        rng, t = np.random.default_rng(seed), np.arange(0.0, 12.0, 0.005)
        x = 0.02 + 0.015 * np.sin((1.0 + seed) * t)
        force = 4.909e-4 * 2e5 + 60.0 * np.gradient(x, t) + 0.1 * rng.standard_normal(len(t))
        return pd.DataFrame({"trajectory": "r", "time": t, "x": x, "P": 301325.0 + 0.0 * t, "F": force})

    page = tmp_path / "sim.toml"
    page.write_text('kind = "cylinder"\n[cylinder]\nbore = "25 mm"\n')
    piston = pamid.read_simulator(page)
    assert isinstance(piston, Cylinder)
    first = pamid.diagnose(run(0), piston, ["viscous_friction", "force_bias"])
    second = pamid.diagnose(run(1), piston, since=first.history)
    assert second.causes[0].effects == ("viscous_friction",) and len(second.rounds) == 2
    second.history.page = str(page)
    second.history.write(tmp_path)
    again = read_history(tmp_path, read=pamid.read_simulator)
    assert list(again.logs) == ["log", "log 2"] and again.rounds == second.rounds
    (tmp_path / "stage").mkdir()
    second.history.write(tmp_path / "stage", tmp_path)  # files that replace others are written elsewhere and moved
    assert json.loads((tmp_path / "stage" / "state.json").read_text())["simulator"]["page"] == "sim.toml"


MOTOR = FunctionSimulator(
    lambda t, x, u, p: [x.dq, (p.k * u.u + u.load) / p.J],
    [
        Port("u", "input", "V"), Port("load", "input", "N m"), Port("phi", "output", "rad"),
        Port("w", "output", "rad/s"), Port("q", "state", "rad"), Port("dq", "state", "rad/s"),
        Port("shaft", "joint", "N m", position="q", velocity="dq", through="load"),
    ],
    {"k": (0.05, 0.0, "N m/V"), "J": (2e-3, 0.0, "kg m^2")},
    output=lambda t, x, u, p: [x.q, x.dq],
)  # fmt: skip


def turned(seed: int, damping: float) -> pd.DataFrame:
    """A motor whose damping, which its simulator lacks, changes its motion many times over."""
    found = []
    for k in range(2):
        rng, t, w, phi, rows = np.random.default_rng([seed, k]), np.arange(0, 6, 0.02), 0.0, 0.0, []
        rates, phases = 2 * np.pi * rng.uniform(0.1, 0.8, 3), rng.uniform(0, 6, 3)
        volt = 2.5 * sum(np.sin(r * t + p) - np.sin(p) for r, p in zip(rates, phases, strict=True))
        for u in volt:
            rows.append((phi, w))
            for _ in range(20):
                phi, w = phi + 1e-3 * w, w + 1e-3 * (0.05 * u - damping * w) / 2e-3
        shown = np.array(rows) + [1e-3, 5e-2] * rng.standard_normal((len(t), 2))
        found.append(pd.DataFrame({"trajectory": f"{k}", "time": t, "u": volt, "phi": shown[:, 0], "w": shown[:, 1]}))
    return pd.concat(found, ignore_index=True)


@pytest.mark.slow
def test_a_large_cause_that_doubles_is_found_among_effects_that_first_order_prefers() -> None:
    library = ["actuator_hysteresis", "parameter_deviation", "actuator_dead_zone", "hysteresis", "viscous_friction"]
    found = diagnose_simulator({"monday": turned(1, 4e-3), "friday": turned(3, 8e-3)}, MOTOR, library)
    (cause,), (change,) = found.causes, found.changes
    assert cause.effects == ("viscous_friction",)
    assert (change.effect, change.how, change.log) == ("viscous_friction", "grows", "friday")
    assert (change.before, change.after) == pytest.approx((4e-3, 8e-3), rel=0.02)


def test_each_effect_of_a_class_keeps_its_own_parameters() -> None:
    variants = Variants(["creep", "maxwell"], all_effects(), ["a", "b"], ["1", "2"])
    sizes = [{name: ParameterEstimate(1.0, "N", (0.9, 1.1))} for name in ("stiffness", "amplitude", "damping")]
    one = Cause(
        ("creep", "creep@from 2", "maxwell"), "x", 0.9, 0.5, share_ci90=(0.4, 0.6), parameters=sizes[0],
        others=(sizes[1], sizes[2]),
    )  # fmt: skip
    other = replace(one, effects=("creep@from 2", "maxwell"), others=(sizes[2],))
    for causes in ([one], [one, other]):
        (found,) = _causes(causes, [], variants)
        assert found.effects == ("creep", "maxwell") and found.others == (sizes[2],)


# --- on the command line ------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, days) -> Path:
    folder = tmp_path_factory.mktemp("rail")
    for name, log in days.items():
        log.to_csv(folder / f"{name}.csv", index=False)
    (folder / "rail.py").write_text(CODE)
    (folder / "sim.toml").write_text(PAGE)
    code = main(
        ["diagnose", str(folder / "monday.csv"), "--sim", str(folder / "sim.toml"), "--trust", "--quiet",
         "--effects", ",".join(LIBRARY), "--out", str(folder / "first")]
    )  # fmt: skip
    assert code == 0
    return folder


def test_the_command_goes_on_with_a_further_log(written: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = written / "second"
    (written / "elsewhere").mkdir()
    log = (written / "elsewhere" / "friday.csv").as_posix()
    Path(log).write_text((written / "friday.csv").read_text())
    asked = ["diagnose", log, "--since", str(written / "first"), "--out", str(out), "--quiet"]
    assert main(asked) == 2  # the page of the earlier diagnosis names code
    assert "--trust" in capsys.readouterr().err
    assert main([*asked, "--trust"]) == 0
    assert "Coulomb friction at x appears with friday" in capsys.readouterr().out.replace("\n         ", " ")
    said = json.loads((out / "diagnosis.json").read_text())
    assert len(said["rounds"]) == 2 and said["changes"][0]["where"] == "x"
    page = (out / "report.html").read_text()
    assert "Before and after this log" in page and "Log by log" in page


def test_a_history_is_of_its_simulator_and_of_nobody_else(written: Path, tmp_path: Path) -> None:
    with pytest.raises(UntrustedCodeError):
        read_history(written / "first")
    with pytest.raises(IncompatibleError, match=r"m was 2\.0 and is 2\.5"):
        read_history(written / "first", RAIL.with_({"m": 2.5}))
    assert read_history(written / "first", RAIL).rivals
    for name in ("state.json", "logs.parquet"):
        (tmp_path / name).write_bytes((written / "first" / name).read_bytes())
    state = json.loads((tmp_path / "state.json").read_text())
    state["rivals"] = []
    (tmp_path / "state.json").write_text(json.dumps(state))
    with pytest.raises(LogFormatError, match="has changed since"):
        read_history(tmp_path, RAIL)


def test_several_logs_and_conditions_on_the_command_line(written: Path, tmp_path: Path) -> None:
    table = tmp_path / "conditions.csv"
    table.write_text("log,day\nmonday,1\nfriday,2\n")
    logs = [str(written / f"{name}.csv") for name in ("monday", "friday")]
    options = ["--sim", str(written / "sim.toml"), "--trust", "--quiet", "--effects", ",".join(LIBRARY)]
    assert main(["diagnose", *logs, *options, "--conditions", str(table), "--out", str(tmp_path / "out")]) == 0
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [f["log"] for f in said["logs"]] == ["monday", "friday"] and said["changes"]


def test_evaluate_refits_and_reads_in_pieces(written: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["evaluate", str(written / "monday.csv"), "--sim", str(written / "sim.toml"), "--trust", "--quiet"]
    assert main([*asked, "--json"]) == 0
    whole = json.loads(capsys.readouterr().out)["equations"]["x"]["rmse"]
    assert main([*asked, "--json", "--piece-rows", "600"]) == 0
    assert json.loads(capsys.readouterr().out)["equations"]["x"]["rmse"] == pytest.approx(whole, rel=0.01)
    assert main([*asked, "--refit", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["refit"]["at_bound"] == ["m"] and said["equations"]["x"]["rmse"] < whole

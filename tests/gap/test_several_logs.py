"""Several logs, one diagnosis; the runs that are designed after it; and what a later diagnosis goes on from."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate, sine, triangle
from pamid.cli import main
from pamid.cli.commands.demo import second_round
from pamid.effects import all_effects
from pamid.errors import (
    ExcitationError,
    IncompatibleError,
    LogFormatError,
    LogNotFoundError,
    MissingColumnError,
    PamidError,
    ParameterError,
    TruncatedLogError,
    UnknownOptionError,
)
from pamid.gap.design.bench import Bench
from pamid.gap.design.family import KINDS, STANDARD, DesignedRun, Limits
from pamid.gap.design.known import fit_of, known_of
from pamid.gap.design.plan import TELLS, Plan
from pamid.gap.design.runs_file import read_runs, runs_text
from pamid.gap.design.score import Discrimination
from pamid.gap.design.search import plan_next
from pamid.gap.diagnosis.rivals import Rival
from pamid.gap.residuals.bench import Evidence
from pamid.gap.several import Conditions, diagnose_logs, read_conditions
from pamid.gap.several.go_on import go_on
from pamid.gap.several.history import History, _mark, read_history
from pamid.gap.several.stacked import Log, StackedEvidence
from pamid.report.next_run import outcomes, summary

NOMINAL = BenchParameters.for_muscle("B")
RUNS = [sine(2, 10, 900), sine(6, 10, 900)]
LEAK = [("leakage", {"conductance": 2e-10})]
SLOW = [sine(1, 10, 1500), triangle(1.5, 8, 1500)]


@pytest.fixture(scope="module")
def healthy() -> pd.DataFrame:
    return simulate(NOMINAL, RUNS, seed=0)


@pytest.fixture(scope="module")
def leaking() -> pd.DataFrame:
    return simulate(NOMINAL, RUNS, seed=1, effects=LEAK)


@pytest.fixture(scope="module")
def dead() -> pd.DataFrame:
    return simulate(NOMINAL, SLOW, seed=0, effects=["dead_volume"])


# --- several logs -------------------------------------------------------------------------------------------
def test_stacked_residuals_are_those_of_each_log(healthy: pd.DataFrame, leaking: pd.DataFrame) -> None:
    each = [Evidence(healthy, NOMINAL), Evidence(leaking, NOMINAL)]
    stack = StackedEvidence([Log("a", each[0], "a"), Log("b", each[1], "b")])
    spec = {"leakage": {"conductance": 1e-10}}
    x = np.linspace(-0.5, 0.5, len(stack.free))
    z = stack.tangent(spec, x) + stack.J @ x
    for k, source in enumerate(each):
        mine = stack.deviations_in(k, x)
        np.testing.assert_allclose(z[stack.places[k]], source.tangent(spec, mine) + source.J @ mine, atol=1e-9)
    np.testing.assert_allclose(stack.raw(stack.white(z)), z, atol=1e-8)


def test_geometry_is_shared_and_the_valve_is_each_days_own(healthy: pd.DataFrame) -> None:
    evidence = Evidence(healthy, NOMINAL)
    stack = StackedEvidence([Log("a", evidence, "mon"), Log("b", evidence, "fri")])
    assert stack.free.count("braid_angle") == 1
    assert {"sonic_conductance (mon)", "sonic_conductance (fri)"} <= set(stack.free)
    same = StackedEvidence([Log("a", evidence, "mon"), Log("b", evidence, "mon")])
    assert same.free == evidence.free


def test_a_leak_that_opens_between_two_days_is_named_with_its_log(healthy: pd.DataFrame, leaking: pd.DataFrame) -> None:
    found = diagnose_logs({"monday": healthy, "friday": leaking}, NOMINAL, ["leakage", "viscous_friction", "flow_bias"])
    assert [c.effects[0] for c in found.causes] == ["leakage"]
    assert [(c.effect, c.how, c.log) for c in found.changes] == [("leakage", "appears", "friday")]
    low, high = found.logs[1].parameters["leakage"]["conductance"].ci90
    assert low < 2e-10 < high
    assert not found.logs[0].parameters
    assert abs(sum(c.confidence for c in found.candidates) - 1.0) < 1e-9
    assert dict(found.corrected.effects)["leakage"]["conductance"] == pytest.approx(2e-10, rel=0.1)
    assert json.loads(found.to_json())["changes"][0]["log"] == "friday"


def test_a_cause_that_stays_has_not_changed(leaking: pd.DataFrame) -> None:
    other = simulate(NOMINAL, [sine(4, 8, 900), sine(3, 12, 900)], seed=2, effects=LEAK)
    found = diagnose_logs({"monday": leaking, "friday": other}, NOMINAL, ["leakage", "viscous_friction"])
    assert [c.effects for c in found.causes] == [("leakage",)]
    assert not found.changes


def test_a_valve_that_saturates_in_one_of_two_logs_is_no_other_bench() -> None:
    stuck = [("valve_saturation", {"limit": 0.1})]
    runs = {
        "slow": [sine(1, 5, 1200)],
        "fast": [DesignedRun("isobaric", 1.5, frequency=9.0, amplitude=22.0).trajectory("fast")],
    }
    logs = {name: simulate(NOMINAL, run, effects=stuck, seed=0) for name, run in runs.items()}
    found = diagnose_logs(logs, NOMINAL, ["valve_saturation", "supply_droop"])
    assert [c.effects[0] for c in found.causes] == ["valve_saturation"]


def test_logs_that_cannot_be_of_one_bench_are_refused(healthy: pd.DataFrame) -> None:
    larger = healthy.assign(F1=2.5 * healthy["F1"], F2=2.5 * healthy["F2"])
    with pytest.raises(IncompatibleError, match=r"force.*first.*second"):
        diagnose_logs({"first": healthy, "second": larger}, NOMINAL, ["leakage"])
    flow = healthy.drop(columns=["F1", "F2"])
    force = healthy.drop(columns=["mdot1", "mdot2", "u1", "u2"])
    with pytest.raises(MissingColumnError, match=r"first lacks F1, F2 and second lacks mdot1, mdot2, u1, u2"):
        diagnose_logs({"first": flow, "second": force}, NOMINAL, ["leakage"])


def test_a_table_of_conditions_is_read_and_checked(tmp_path: Path) -> None:
    file = tmp_path / "conditions.csv"
    file.write_text("log,day,temperature\nmonday,1,\nfriday,2,303\n")
    found = read_conditions(file)
    assert found == {"monday": Conditions({}, "1"), "friday": Conditions({"temperature": 303.0}, "2")}
    file.write_text("log,temprature\nmonday,300\n")
    with pytest.raises(UnknownOptionError, match="temperature"):
        read_conditions(file)
    file.write_text("log,temperature\nmonday,warm\n")
    with pytest.raises(ParameterError, match="Row 2"):
        read_conditions(file)
    for again in ("monday", "monday.csv"):
        file.write_text(f"log,day\nmonday,1\n{again},2\n")
        with pytest.raises(ParameterError, match="Row 3"):
            read_conditions(file)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("\ufefflog,day\nmonday\n", "Row 2 of .* has 1 fields"),
        ("log,day\nx,monday,1\n", "Row 2 of .* has 3 fields"),
        ("log,temperature\nmonday,nan\n", "temperature is nan"),
        ("log,temperature\nmonday,25\n", "temperature is 25"),
        ("log,temperature\nmonday,1e300\n", "temperature is 1e"),
        ("log,temperature,temperature\nmonday,290,300\n", "'temperature' twice"),
        ("log,temperature [K]\nmonday,290\n", "not a simulator parameter"),
        ('log,day\n"monday,1\n', "is not a table"),
        ("log;day\nmonday;1\n", "a column 'log'"),
        ("log,day\n" + "monday,1\n" * 200_000, "at most 1,000,000"),
    ],
)
def test_a_damaged_table_of_conditions_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "conditions.csv").write_text(text)
    with pytest.raises(PamidError, match=words):
        read_conditions(tmp_path / "conditions.csv")


def test_a_history_is_refused_where_simulator_or_library_changed(
    tmp_path: Path, leaking: pd.DataFrame, monkeypatch: pytest.MonkeyPatch
) -> None:
    history = History(NOMINAL, ["leakage", "flow_bias"])
    go_on(history, {"first": leaking})
    history.write(tmp_path)
    again = read_history(tmp_path, NOMINAL)
    pd.testing.assert_frame_equal(again.logs["first"], leaking, check_dtype=False)
    assert again.rounds == history.rounds
    with pytest.raises(IncompatibleError, match=r"inertia was 0\.02 and is 0\.03"):
        read_history(tmp_path, NOMINAL.replace(inertia=0.03))
    with pytest.raises(ParameterError, match="part of the earlier"):
        go_on(again, {"first": leaking})
    monkeypatch.setattr("pamid.gap.several.history.fingerprint", lambda *_: "0" * 16)
    with pytest.raises(IncompatibleError, match="effect leakage differs"):
        read_history(tmp_path, NOMINAL)
    with pytest.raises(LogNotFoundError):
        read_history(tmp_path / "nowhere")


def test_what_somebody_has_edited_is_no_posterior(tmp_path: Path, leaking: pd.DataFrame) -> None:
    history = History(NOMINAL, ["leakage"])
    go_on(history, {"first": leaking})
    history.write(tmp_path)
    state, logs = tmp_path / "state.json", tmp_path / "logs.parquet"
    text, whole = state.read_text(), json.loads(state.read_text())
    assert read_history(tmp_path).rivals == history.rivals

    def refused(content: str, words: str) -> None:
        state.write_text(content)
        for sim in (NOMINAL, None):
            with pytest.raises(LogFormatError, match=words):
                read_history(tmp_path, sim)

    for key in whole:
        refused(json.dumps({**whole, key: None}), "has changed since|cannot be continued")
        refused(json.dumps({k: v for k, v in whole.items() if k != key}), "has changed since|cannot be continued")
    refused(text.replace('"leakage"', '"creep"'), "has changed since")
    for broken in ("", "[" * 200_000, '{"schema": ' + "9" * 6000 + "}", "[]", "null", text[:-200]):
        refused(broken, "cannot be continued|has changed since")
    for change in ({"rivals": [{**whole["rivals"][0], "effects": {"nosuch": {}}}]}, {"logs": 3}, {"rounds": [{}]}):
        crafted = {k: v for k, v in {**whole, **change}.items() if k != "mark"}
        refused(json.dumps({**crafted, "mark": _mark(crafted, logs)}), "cannot be continued")
    state.write_text(text)
    table = pd.read_parquet(logs)
    table.assign(F1=0.0).to_parquet(logs, index=False)
    with pytest.raises(LogFormatError, match="has changed since"):
        read_history(tmp_path)
    crafted = {k: v for k, v in whole.items() if k != "mark"}
    for change in ({"q": "x"}, {"P1": 0.0}, {"log": "another"}):
        table.assign(**change).to_parquet(logs, index=False)
        refused(json.dumps({**crafted, "mark": _mark(crafted, logs)}), "cannot be continued")
    for column in ("trajectory", "time", "q", "log"):
        table.drop(columns=column).to_parquet(logs, index=False)
        refused(json.dumps({**crafted, "mark": _mark(crafted, logs)}), f"cannot be continued.* {column}")
    table[:-5].to_parquet(logs, index=False)
    refused(json.dumps({**crafted, "mark": _mark(crafted, logs)}), "another number of rows")
    table.to_parquet(logs, index=False)
    for key in ("parameter", "value", "low", "high", "unit"):
        told = {
            n: {k: v for k, v in said.items() if k != key} for n, said in crafted["rounds"][0]["parameters"].items()
        }
        less = {**crafted, "rounds": [{**crafted["rounds"][0], "parameters": told}]}
        refused(json.dumps({**less, "mark": _mark(less, logs)}), f"cannot be continued.* has no {key}")
    logs.write_bytes(b"PAR1 and no more")
    state.write_text(json.dumps({**crafted, "mark": _mark(crafted, logs)}))
    with pytest.raises(TruncatedLogError, match="damaged"):
        read_history(tmp_path)


def test_after_no_gap_nothing_is_called_undecided() -> None:
    from pamid.gap.design.next_run import _left
    from pamid.gap.diagnosis.rivals import Rival
    from pamid.gap.several.history import Round

    history = History(NOMINAL, ["creep"])
    history.rivals = [Rival({"creep": {"ratio": 0.05, "time_constant": 2.0}}, {}, 3.0, 0.51), Rival({}, {}, 2.9, 0.49)]
    for verdict, left in (("none", [()]), ("single", [("creep",), ()])):
        history.rounds = [Round(["log"], 10.0, verdict, {}, {}, 1.0)]
        assert [r.names for r in _left(history)] == left
    history.rivals, history.rounds = history.rivals[:1], [Round(["log"], 10.0, "none", {}, {}, 1.0)]
    assert [r.names for r in _left(history)] == [()]


# --- designs ------------------------------------------------------------------------------------------------
def test_drawn_runs_keep_the_limits() -> None:
    rng, limits = np.random.default_rng(0), Limits(angle=15.0, rate=100.0, frequency=9.0, pressure=5e4, shut=False)
    for kind in [k for k in KINDS if k != "sealed"] * 6:
        for run in (first := limits.draw(rng, kind), limits.near(rng, first, 0.25)):
            told = run.trajectory("x")
            assert np.degrees(np.abs(told.q_ref).max()) <= 15.0 + 1e-6
            rate = np.degrees(np.abs(np.diff(told.q_ref[told.lead :])).max()) * 1e3
            assert rate <= 100.0 * (1.2 if kind == "triangle" else 1.0) + 1.0
            assert told.n_samples == 4000 and told.q_ref[0] == 0.0
            assert abs(run.pressure) <= 5e4
    assert "sealed" not in limits.kinds
    with pytest.raises(ParameterError):
        Limits(runs=6)
    with pytest.raises(ParameterError, match=r"0\.8 bar are 80000"):
        Limits(pressure=0.8)
    with pytest.raises(ParameterError, match="180 at most"):
        Limits(angle=720.0)


def test_a_designed_run_tells_what_slow_sines_leave_open(dead: pd.DataFrame) -> None:
    library = ["dead_volume", "polytropic_exponent", "gas_temperature", "length"]
    history = History(NOMINAL, library)
    first = go_on(history, {"first": dead})
    assert len(first.rivals) > 1 and abs(sum(r.belief for r in first.rivals) - 1.0) < 1e-9
    plan = plan_next(first.rivals, {"first": dead}, NOMINAL, Limits(seconds=2.0), designs=16)
    assert plan.tells and len(plan.runs) == 1 and plan.designs <= 16
    assert "dead volume" in summary(plan) and any("If it is" in text for text in outcomes(plan))
    log = simulate(NOMINAL, plan.trajectories(), seed=5, effects=["dead_volume"])
    found = go_on(history, {"second": log})
    assert [c.effects for c in found.causes] == [("dead_volume",)]
    assert len(found.rounds) == 2 and found.rounds[1].seconds > found.rounds[0].seconds
    points = plan.set_points()
    assert points["time"].min() < 0 and len(points[points["time"] >= 0]) == 2000
    told = read_runs_of(plan)
    np.testing.assert_array_equal(told.q_ref, plan.trajectories()[0].q_ref)


def read_runs_of(plan: Plan) -> object:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "runs.toml"
        file.write_text(runs_text(plan.runs, plan.names))
        return read_runs(file)[0]


def test_no_run_is_named_where_none_could_tell(dead: pd.DataFrame) -> None:
    one = Rival({"dead_volume": {"volume": 1e-5}}, {}, 0.0, 0.5)
    same = Rival({"dead_volume": {"volume": 1.0001e-5}}, {}, 0.0, 0.5)
    plan = plan_next([one, same], {"log": dead}, NOMINAL, Limits(seconds=1.0), designs=8)
    assert not plan.tells and not plan.runs and len(plan.closest) == 1
    assert "No run of 1 s" in summary(plan)
    assert plan.closest[0].words.rpartition(", ")[0] in summary(replace(plan, needed=12.0))


def test_parameters_are_determined_where_one_explanation_is_left(leaking: pd.DataFrame) -> None:
    rival = Rival({"leakage": {"conductance": 2e-10}}, {}, 0.0, 1.0)
    plan = plan_next([rival], {"log": leaking}, NOMINAL, Limits(seconds=2.0, runs=2), designs=10)
    assert plan.purpose == "parameters" and len(plan.runs) == 2
    assert plan.shrinks["leakage.conductance"] > 1.1
    with patch("pamid.gap.design.search.NARROWS", 1e3):
        plan = plan_next([rival], {"log": leaking}, NOMINAL, Limits(seconds=1.0), designs=8)
    assert not plan.tells and not plan.runs and len(plan.closest) == 1
    assert "no run within the limits" in summary(plan)


def test_where_no_effect_is_left_the_run_shows_what_could_not_have_shown() -> None:
    slow, none = simulate(NOMINAL, SLOW, seed=0), [Rival({}, {}, 0.0, 1.0)]
    library = ["leakage", "valve_saturation"]
    plan = plan_next(none, {"log": slow}, NOMINAL, Limits(seconds=2.0), designs=24, library=library)
    assert plan.purpose == "unseen" and plan.tells and len(plan.runs) == 1
    assert plan.explanations == [(), ("valve_saturation",)]  # a leak of typical size would have shown
    assert "valve saturation" in summary(plan) and "falls behind" in outcomes(plan)[0]
    # The valve opens further in it, so far that a typical limit shows.
    again = simulate(NOMINAL, plan.trajectories(), seed=0)
    assert again[["u1", "u2"]].abs().max().max() > 2.0 * slow[["u1", "u2"]].abs().max().max()
    calm = Limits(seconds=1.0, angle=4.0, rate=5.0, frequency=1.0, pressure=0.0, rise=0.0, shut=False)
    plan = plan_next(none, {"log": slow}, NOMINAL, calm, designs=8, library=library)
    assert not plan.tells and not plan.runs and "No run within the limits would show them" in summary(plan)
    assert plan_next(none, {"log": slow}, NOMINAL, library=["leakage"], designs=8).purpose == "none"


def test_a_file_of_runs_that_are_none_says_so(tmp_path: Path) -> None:
    file = tmp_path / "runs.toml"
    for text, said in (
        ("nothing", "cannot be read"),
        ("[[run]]\nkind = 'sine'", "seconds"),
        ("[[run]]\nkind = 'zigzag'\nseconds = 1", "zigzag"),
        ("[[run]]\nkind = 'sine'\nseconds = 1\nspeed = 3", "speed"),
    ):
        file.write_text(text)
        with pytest.raises(Exception, match=said):
            read_runs(file)
    assert DesignedRun("hold", 1.0).as_dict() == {"kind": "hold", "seconds": 1.0, "offset": 0.0, "pressure": 0.0}


# --- the command line ---------------------------------------------------------------------------------------
def test_the_loop_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(tmp_path)
    NOMINAL.replace(effects=[("dead_volume", {})]).to_toml(tmp_path / "bench.toml")
    kinds = "sine:frequency=1,amplitude=10,seconds=1.5", "triangle:frequency=1.5,amplitude=8,seconds=1.5"
    runs = [word for kind in kinds for word in ("--trajectory", kind)]
    record = ["simulate", "--sim", f"{folder}/bench.toml", "--quiet"]
    assert main([*record, *runs, "--out", f"{folder}/bench.parquet"]) == 0
    sim, library = (
        ["--sim", f"{folder}/bench.sim.toml"],
        ["--effects", "dead_volume,polytropic_exponent,gas_temperature"],
    )
    quiet = ["--quiet"]
    assert main(["diagnose", f"{folder}/bench.parquet", *sim, *library, "--out", f"{folder}/diagnosis", *quiet]) == 0
    commands = [command for _, command in second_round(tmp_path)]
    assert [command[0] for command in commands] == ["next", "simulate", "diagnose"]
    for command in commands:
        assert main([*command, *quiet]) == 0
    capsys.readouterr()
    said = json.loads((tmp_path / "diagnosis-2" / "diagnosis.json").read_text())
    assert len(said["rounds"]) == 2 and said["causes"][0]["effects"][0] == "dead_volume"
    page = (tmp_path / "diagnosis-2" / "report.html").read_text()
    assert "Before and after this log" in page and "Log by log" in page
    capsys.readouterr()
    since = ["--since", f"{folder}/diagnosis", "--out", f"{folder}/three", *quiet]
    (tmp_path / "alone").mkdir()
    log = (tmp_path / "second.parquet").rename(tmp_path / "alone" / "second.parquet")
    # No simulator file is in the log's folder: that of the earlier diagnosis is taken.
    assert main(["diagnose", str(log), *since, *library]) == 2
    assert "--effects or --without is given with --since" in capsys.readouterr().err


def test_several_logs_that_leave_a_class_name_the_run_that_distinguishes_it() -> None:
    library = ["dead_volume", "polytropic_exponent", "gas_temperature"]
    slow = [sine(1, 10, 1500), triangle(1.5, 8, 1500)]
    logs = {name: simulate(NOMINAL, slow, effects=["dead_volume"], seed=k) for k, name in enumerate(("one", "two"))}
    found = diagnose_logs(logs, NOMINAL, library)
    assert len(found.causes[0].effects) > 1
    assert found.next_run is not None
    assert set(found.next_run.separates) <= set(library)
    assert found.next_run.trajectory in [run.as_dict() for run in STANDARD]
    assert found.next_run.expected >= TELLS


def test_a_second_cause_takes_no_confidence_from_the_first() -> None:
    both = [("leakage", {"conductance": 2e-10}), ("viscous_friction", {})]
    history = History(NOMINAL, ["leakage", "viscous_friction", "dead_volume"])
    found = go_on(history, {"one": simulate(NOMINAL, RUNS, effects=both, seed=0)})
    assert found.verdict == "several"
    sure = history.rounds[0].confidences
    assert {c.effects[0]: c.confidence for c in found.causes} == pytest.approx(
        {name: sure[name] for name in ("leakage", "viscous_friction")}
    )
    assert min(sure["leakage"], sure["viscous_friction"]) > 0.6


def test_a_demo_whose_log_tells_one_effect_has_no_second_round(tmp_path: Path) -> None:
    (tmp_path / "diagnosis").mkdir()
    found = tmp_path / "diagnosis" / "diagnosis.json"
    found.write_text(json.dumps({"causes": [{"effects": ["coulomb_friction"]}]}))
    assert second_round(tmp_path) == []
    found.write_text(json.dumps({"causes": []}))
    assert second_round(tmp_path) == []


def test_a_live_finding_says_which_run_would_confirm_it() -> None:
    from pamid.gap.design.confirm import confirming

    run = confirming("leakage", NOMINAL, seconds=1.0, designs=8)
    assert run is not None and run.kind in KINDS and run.seconds == 1.0


def test_the_next_run_of_one_equation_stays_within_the_log() -> None:
    from pamid.estimators import GapDiagnoser

    t = np.tile(np.arange(0, 4, 0.004), 3)
    run, w = np.repeat(np.arange(3), 1000), np.repeat([2.0, 2.2, 2.4], 1000)
    rng = np.random.default_rng(0)
    X = pd.DataFrame({"time": t, "eps": 0.1 + 0.05 * np.sin(w * t), "deps": 0.05 * w * np.cos(w * t)})
    y = -1.5 * X["deps"] + 0.2 * rng.standard_normal(len(X))
    library = ["viscous_friction", "coulomb_friction", "quadratic_drag"]
    found = GapDiagnoser(effects=library, random_state=0).fit(X, y, groups=run).next_run_
    assert found is not None and "viscous_friction" in found.separates
    swing = found.trajectory["eps_amplitude"]
    assert found.trajectory["eps"] - swing >= 0.05 and found.trajectory["eps"] + swing <= 0.15


def test_a_joint_at_rest_is_a_log_beside_one_of_motion(healthy: pd.DataFrame) -> None:
    still = DesignedRun("hold", 1.0, offset=0.0)
    more = simulate(NOMINAL, [still.trajectory("held")], seed=3)
    found = diagnose_logs({"first": healthy, "held": more}, NOMINAL, ["leakage", "flow_bias"])
    assert found.verdict == "none"
    with pytest.raises(ExcitationError, match="held: Hardly anything moves"):
        diagnose_logs({"held": more}, NOMINAL, ["leakage"])


def test_parameters_that_a_run_determines_cost_evidence(healthy: pd.DataFrame) -> None:
    bench = Bench(NOMINAL, [Evidence(healthy, NOMINAL)], Limits())
    values = [dict(all_effects()[name]().values) for name in ("coulomb_friction", "stribeck_friction")]
    values[1] |= {"coulomb": values[0]["amplitude"], "breakaway": 1e-3}
    rivals = [
        Rival({n: v}, {}, 0.0, 0.5) for n, v in zip(("coulomb_friction", "stribeck_friction"), values, strict=True)
    ]
    rng = np.random.default_rng(0)
    known = [known_of(bench.logs, fit_of(r, bench.logs[0]), 0.5, rng) for r in rivals]
    trial = Evidence(simulate(NOMINAL, [sine(8, 15, 500)], seed=5), NOMINAL)
    told = Discrimination(trial, known, forms=False)
    H = [k.precision.copy() for k in known]
    for k, h in zip(known, H, strict=True):
        assert k.price(100.0 * h, 10 * k.windows) > k.price(h, k.windows)  # more is known
    dearer = [told._dearer(k, [0]) for k in range(2)]
    assert dearer[1] != dearer[0]
    cost = [told._refitted(0, j, [0])[0][0] for j in range(2)]  # what one pays for its parameters, the other gains
    assert told.between([0])[0, 1] == pytest.approx(cost[1] - min(cost[0], 0.0) + dearer[1] - dearer[0], abs=1e-6)

"""``pamid init``: what it guesses, asks, writes and refuses."""

from __future__ import annotations

import io
import json
import tomllib

import numpy as np
import pandas as pd
import pytest
import scipy.io

from pamid.bench import BenchParameters, simulate, sine
from pamid.cli import main
from pamid.signals import LogMapping, read_log
from pamid.signals.guess import guess_columns, guess_kind
from pamid.signals.headers import read_header
from pamid.systems import all_systems, read_system
from pamid.systems.draft import kinds

TIME = np.arange(0, 3, 0.01)
BAR = 3.0 + np.sin(4 * TIME)


@pytest.fixture
def muscle(tmp_path):
    table = {
        "t [ms]": 1000 * TIME,
        "pressure [bar]": BAR,
        "length_mm": 180 - 8 * np.sin(4 * TIME),
        "load cell": 50 + 9 * BAR,
        "note": "a",
    }
    pd.DataFrame(table).to_csv(tmp_path / "run-1.csv", index=False)
    return tmp_path / "run-1.csv"


@pytest.fixture
def nameless(tmp_path):
    table = np.column_stack([1000 * TIME, 20 + 15 * np.sin(TIME), BAR, 49.1 * BAR])
    np.savetxt(tmp_path / "raw.txt", table, fmt="%.3f")
    return tmp_path / "raw.txt"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def made(folder, log, *argv: str) -> pd.DataFrame:
    assert main(["init", str(log), *argv, "--out", str(folder), "--quiet"]) == 0
    return read_log(log, folder / "columns.toml")


# --- guessing ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "values", "kind", "signal", "unit"),
    [
        ("Zeit_ms", 10 * np.arange(99), "muscle", "time", "ms"),
        ("timestamp", np.arange(99) * 1e-3, "muscle", "time", None),
        ("clock", 2000.0 * np.arange(99), "muscle", "time", "us"),
        ("Druck / kPa", 300 + np.arange(99), "muscle", "P", "kPa"),
        ("p1", 2 + 0.01 * np.arange(99), "bench", "P1", "bar"),
        ("PressureLeft", 2e5 + np.arange(99), "bench", "P1", None),
        ("pressure antagonist (psi)", 20 + np.arange(99), "bench", "P2", "psi"),
        ("jointAngle", np.linspace(-20, 20, 99), "bench", "q", "deg"),
        ("goal angle", np.linspace(-1, 1, 99), "bench", "q_ref", None),
        ("position", np.linspace(-1, 1, 99), "joint", "q", None),
        ("position", np.linspace(0, 37, 99), "cylinder", "x", "mm"),
        ("displacement", np.linspace(0, 37, 99), "muscle", "eps", "mm"),
        ("contraction", np.linspace(0, 21, 99), "muscle", "eps", "%"),
        ("valve_cmd_2", np.linspace(-90, 90, 99), "bench", "u2", "%"),
        ("current", np.linspace(-1, 1, 99), "joint", "drive", None),
        ("input_volts", np.linspace(15, 16, 99), "joint", "voltage", "V"),
        ("current", np.linspace(-1, 1, 99), "muscle", "", None),
        ("massflow1", np.linspace(-1e-4, 1e-4, 99), "bench", "mdot1", None),
        ("temperature", np.linspace(20, 30, 99), "bench", "", None),
        ("speed", np.linspace(-1, 1, 99), "joint", "", None),
    ],
)
def test_a_column_is_recognised(name, values, kind, signal, unit):
    (guess,) = guess_columns(pd.DataFrame({name: values}), kind=kind)
    assert (guess.signal, guess.unit) == (signal, unit)


def test_gauge_and_absolute_are_told_apart_where_they_can_be():
    def gauge(name: str, low: float, high: float):
        found = guess_columns(pd.DataFrame({name: np.linspace(low, high, 99)}), kind="muscle")[0]
        return found.gauge if found.settled else "open"

    assert gauge("pressure [bar]", 0.0, 6.0) is True
    assert gauge("P [bar]", 0.0, 6.0) is True  # no absolute pressure falls so low
    assert gauge("pressure [bar]", 0.94, 7.06) == "open"
    assert gauge("pressure [bar]", 1.19, 2.82) == "open"
    assert gauge("P", 1.2e5, 4e5) is False
    assert gauge("p", 1.2e5, 4e5) is True
    assert gauge("Überdruck [bar]", 2.0, 6.0) is True
    assert gauge("pressure abs [bar]", 2.0, 6.0) is False
    assert gauge("pressure [bara]", 2.0, 6.0) is None  # the unit says it
    assert gauge("Druck [bar(ü)]", 2.0, 6.0) is None


def test_one_signal_is_taken_from_one_column():
    found = guess_columns(pd.DataFrame({"pressure": BAR, "pressure_2": BAR, "P": 1e5 * BAR}), kind="muscle")
    assert [g.signal for g in found] == ["", "", "P"]
    found = guess_columns(pd.DataFrame({"Druck A [bar]": BAR, "Druck B [bar]": BAR}), kind="muscle")
    assert found[0].question == "'Druck A [bar]' and 'Druck B [bar]' may each be P"


def test_kinds_follow_from_signals():
    assert guess_kind({"q", "P1", "P2", "time"}) == "bench"
    assert guess_kind({"eps", "P", "F"}) == "muscle"
    assert guess_kind({"x", "P", "F"}) == "cylinder"
    assert guess_kind({"q", "q_ref"}) == "joint"
    assert guess_kind({"P"}) == ""
    assert set(kinds()) == {"bench", *all_systems()}


@pytest.mark.parametrize(
    ("name", "words", "unit"),
    [
        ("stroke_mm", "stroke", "mm"),
        ("F in N", "f", "N"),
        ("valve_2", "valve 2", None),
        ("Kraft [daN]", "kraft", "daN"),
        ("p/bar", "p", "bar"),
        ("v / (m/s)", "v", "m/s"),
        ("flow_l_min", "flow", "L/min"),
        ("Druck (gefiltert) [mbar]", "druck gefiltert", "mbar"),
        ("Drehzahl in U/min", "drehzahl", "rpm"),
        ("Winkel (Grad)", "winkel", "deg"),
        ("Spannung [N/mm²]", "spannung", "MPa"),
        ("pressure_kPa_gauge_1", "pressure gauge 1", "kPa"),
        ("/joint_states/position[0]", "joint states position 0", None),
        ("[ms]", "", "ms"),
        ("Dev1/ai0", "dev 1 ai 0", None),
    ],
)
def test_words_and_units_of_headers(name, words, unit):
    found = read_header(name)
    assert (" ".join(found.words), found.unit, found.unread) == (words, unit, "")


def test_a_unit_that_is_not_known_is_named():
    assert read_header("Kraft [Nx]").unread == "Nx"
    (guess,) = guess_columns(pd.DataFrame({"Kraft [Nx]": BAR}), kind="cylinder")
    assert "'Nx'" in guess.question
    (guess,) = guess_columns(pd.DataFrame({"flow [l/min]": BAR}), kind="muscle")
    assert "at which conditions" in guess.question
    (guess,) = guess_columns(pd.DataFrame({"Druck [V]": BAR}), kind="cylinder")
    assert (guess.signal, guess.why) == ("", "its unit V is a unit of voltage, not of P")


# --- writing ----------------------------------------------------------------------------------------------------
def test_a_muscle_from_flags(muscle, tmp_path):
    numbers = ["--set", "rest_length=200 mm", "--set", "rest_diameter=20 mm"]
    flags = ["--signal", "F=load cell:N", "--assume", "gauge"]
    log = made(tmp_path / "a", muscle, "--kind", "muscle", *numbers, *flags, "--yes")
    assert log["P"].to_numpy() == pytest.approx(101_325 + 1e5 * BAR)
    assert log["eps"].to_numpy() == pytest.approx(0.1 + 0.04 * np.sin(4 * TIME))
    page = read_system(tmp_path / "a" / "sim.toml")
    assert page.kind == "muscle"
    assert page.values["rest_length"] == pytest.approx(0.2)
    text = (tmp_path / "a" / "sim.toml").read_text()
    assert "ASSUMED" not in text
    assert text.count("#") > 7


def test_what_is_not_given_is_marked(muscle, tmp_path, capsys):
    argv = ["init", str(muscle), "--kind", "muscle", "--json", "--assume", "gauge", "--out", str(tmp_path / "a")]
    assert main(argv) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["assumed"] == {"units": ["F"], "numbers": ["rest_length", "rest_diameter"]}
    assert (tmp_path / "a" / "sim.toml").read_text().count("ASSUMED") == 2
    assert "ASSUMED" in (tmp_path / "a" / "columns.toml").read_text()
    assert report["next"].startswith("pamid check ")
    argv = [str(muscle), "--columns", str(tmp_path / "a" / "columns.toml"), "--sim", str(tmp_path / "a" / "sim.toml")]
    assert main(["check", *argv]) == 0
    assert "still assumes rest_length, rest_diameter" in capsys.readouterr().err


def test_a_bench_with_its_own_names(tmp_path):
    log = simulate(BenchParameters.for_muscle("B"), [sine(4, 20, samples=300)], seed=0)
    renamed = pd.DataFrame(
        {
            "time_ms": 1000 * log["time"],
            "angle_deg": np.degrees(log["q"]),
            "p_left [bar]": (log["P1"] - 101_325) / 1e5,
            "p_right [bar]": (log["P2"] - 101_325) / 1e5,
            "force left": log["F1"],
            "force right": log["F2"],
        }
    )
    renamed.to_csv(tmp_path / "bench.csv", index=False)
    flags = ["--set", "rest_length=200 mm", "--set", "name=mine", "--assume", "gauge", "--yes"]
    again = made(tmp_path / "a", tmp_path / "bench.csv", *flags)
    for name in ("q", "P1", "P2", "F1", "F2", "time"):
        assert again[name].to_numpy() == pytest.approx(log[name].to_numpy(), rel=1e-6, abs=1e-6)
    bench = BenchParameters.from_toml(tmp_path / "a" / "sim.toml")
    assert (bench.muscle.name, bench.muscle.rest_length) == ("mine", 0.2)
    assert "inertia = 0.02  # kg m^2, of everything that turns  ASSUMED" in (tmp_path / "a" / "sim.toml").read_text()


def test_columns_without_names_are_said_by_position(nameless, tmp_path, capsys):
    argv = ["init", str(nameless), "--kind", "cylinder", "--yes", "--out", str(tmp_path / "a")]
    assert main(argv) == 2
    out, err = capsys.readouterr()
    assert "49.1" not in err
    assert "x (stroke), P" in err
    assert "--signal x=COLUMN:UNIT" in err
    assert "196" in out  # the largest force stands in the table of columns
    assert not (tmp_path / "a").exists()
    signals = ["--signal", "x=1:mm", "--signal", "P=2:bar:gauge", "--signal", "F=3:N", "--set", "bore=25 mm"]
    log = made(tmp_path / "a", nameless, "--kind", "cylinder", "--yes", *signals)
    assert log["x"].max() == pytest.approx(0.035, abs=1e-4)
    assert log["time"].max() == pytest.approx(2.99)


def test_a_recorder_that_starts_late_and_thousands_points(tmp_path):
    rows = [
        f"{t:.3f};{b:.3f};{b:.3f}" for t, b in zip([0.0, 5.0, *(900.0 + 10 * np.arange(98))], BAR[:100], strict=True)
    ]
    (tmp_path / "late.csv").write_text("\n".join(rows))
    flags = ["--kind", "cylinder", "--yes", "--signal", "P=1:bar:gauge", "--signal", "F=2:kN", "--constant", "x=0.01"]
    assert len(made(tmp_path / "a", tmp_path / "late.csv", *flags)) == 98
    rows = [f"{1 + 100 * k // 1000}.{100 * k % 1000:03d}.000;{3 + 0.01 * k}" for k in range(99)]
    (tmp_path / "points.csv").write_text("\n".join(rows))
    flags = ["--kind", "cylinder", "--yes", "--signal", "P=1:bar:gauge", "--constant", "x=0.01", "--constant", "F=1"]
    assert made(tmp_path / "b", tmp_path / "points.csv", *flags)["time"].iloc[-1] == pytest.approx(10.8)


def test_runs_as_variables_of_a_matlab_file(tmp_path):
    run = np.column_stack([9 * BAR, 100 * BAR, TIME])
    scipy.io.savemat(tmp_path / "log.mat", {"Test1Data": run, "Test2Data": run, "Offset": run[:20]})
    flags = ["--signal", "F=0:N", "--signal", "P=1:kPa:gauge", "--constant", "length=17.45 cm", "--yes"]
    numbers = ["--set", "rest_length=18.2 cm", "--set", "rest_diameter=10 mm"]
    log = made(tmp_path / "a", tmp_path / "log.mat", "--kind", "muscle", *flags, *numbers)
    assert log["trajectory"].nunique() == 2
    assert log["eps"].iloc[0] == pytest.approx(0.0412, abs=1e-4)
    assert LogMapping.load(tmp_path / "a" / "columns.toml").zero_run == "Offset"


def test_a_number_beside_the_samples_of_a_json_log(tmp_path, capsys):
    entries = [{"timestamp": t, "position": 0.3 * np.sin(t), "goal_position": 0.4 * np.sin(t)} for t in TIME]
    (tmp_path / "servo.json").write_text(json.dumps({"kp": 8, "trajectory": "sine", "entries": entries}))
    log = made(tmp_path / "a", tmp_path / "servo.json", "--kind", "joint", "--signal", "gain=kp*0.5", "--yes")
    assert log["gain"].unique().tolist() == [4.0]
    assert log["trajectory"].iloc[0] == "sine-servo"
    assert "ASSUMED" not in (tmp_path / "a" / "sim.toml").read_text()
    argv = ["init", str(tmp_path / "servo.json"), "--kind", "joint", "--yes", "--out", str(tmp_path / "b")]
    assert main(argv) == 2
    assert "--set gain=NUMBER" in capsys.readouterr().err


def test_hostile_names_stay_text(tmp_path, capsys):
    evil = 'pressure"] }\n[constants] \x1b[31m'
    pd.DataFrame({"time": TIME, evil: BAR, "stroke": 9 * BAR, "F": BAR, "#\n[x]": BAR}).to_parquet(
        tmp_path / "log.parquet"
    )
    flags = ["--signal", f"P={evil}:bar:gauge", "--signal", "x=stroke:mm"]
    made(tmp_path / "a", tmp_path / "log.parquet", "--kind", "cylinder", "--yes", *flags)
    assert main(["check", str(tmp_path / "log.parquet"), "--columns", str(tmp_path / "a" / "columns.toml")]) == 0
    assert main(["init", str(tmp_path / "log.parquet"), "--kind", "bench", "--yes", "--out", str(tmp_path / "b")]) == 2
    assert "\x1b" not in "".join(capsys.readouterr())
    text = (tmp_path / "a" / "columns.toml").read_text()
    assert tomllib.loads(text)["signals"]["P"]["column"] == evil
    assert "\x1b" not in text.replace("\\u001b", "")


# --- gauge or absolute ------------------------------------------------------------------------------------------
def cylinder(folder, *, bias: float = 0.0, above: float = 0.0, force_unit: float = 1.0, name: str = "Druck [bar]"):
    """A cylinder of 25 mm whose pressure sensor reads `bias` bar more than gauge pressure."""
    gauge = 0.3 + above + 2 * np.sin(2 * TIME) ** 2
    newton = 49.09 * gauge + 8 * np.tanh(30 * np.cos(4 * TIME))
    table = {
        "Zeit [s]": TIME,
        "Hub [mm]": 20 + 9 * np.sin(4 * TIME),
        name: gauge + bias,
        "Kraft [N]": newton / force_unit,
    }
    pd.DataFrame(table).to_csv(folder / "cylinder.csv", sep=";", decimal=",", index=False)
    return folder / "cylinder.csv"


BORE = ["--kind", "cylinder", "--set", "bore=25 mm", "--yes"]


@pytest.mark.parametrize("bias", [0.0, 1.01325])
def test_the_force_says_whether_pressure_is_gauge(bias, tmp_path):
    log = made(tmp_path / "a", cylinder(tmp_path, bias=bias, above=0.7), *BORE)
    assert log["P"].min() == pytest.approx(101_325 + 1e5, rel=1e-3)


def test_the_question_is_asked_where_both_readings_are_possible(tmp_path, capsys, monkeypatch):
    log = cylinder(tmp_path, bias=0.5, above=0.7)  # neither reading suits the force
    assert main(["init", str(log), *BORE, "--out", str(tmp_path / "a")]) == 2
    err = capsys.readouterr().err
    assert "may be gauge or absolute" in err
    assert "--assume gauge" in err
    assert made(tmp_path / "b", log, *BORE, "--assume", "absolute")["P"].min() == pytest.approx(1.5e5, rel=1e-3)
    assert made(tmp_path / "c", log, *BORE, "--assume", "gauge")["P"].min() == pytest.approx(251_325, rel=1e-3)
    monkeypatch.setattr("sys.stdin", Terminal("absolute\n"))
    assert main(["init", str(log), *BORE[:-1], "--out", str(tmp_path / "d"), "--quiet"]) == 0
    assert read_log(log, tmp_path / "d" / "columns.toml")["P"].min() == pytest.approx(1.5e5, rel=1e-3)


def test_a_name_and_a_force_that_contradict_each_other(tmp_path, capsys):
    log = cylinder(tmp_path, above=0.9, name="P [bar]")
    assert main(["init", str(log), *BORE, "--out", str(tmp_path / "a")]) == 2
    assert "name says one, but the measured force suggests the other" in capsys.readouterr().err
    assert made(tmp_path / "b", log, *BORE, "--assume", "gauge")["P"].min() == pytest.approx(221_325, rel=1e-3)


def test_the_name_of_the_project_is_absolute(tmp_path):
    P = 101_325 + 1e5 * (0.2 + np.sin(TIME) ** 2)
    table = {
        "time": TIME,
        "x": 0.02 + 0.01 * np.sin(4 * TIME),
        "P": P,
        "F": 4.909e-4 * (P - 101_325) + np.cos(4 * TIME),
    }
    pd.DataFrame(table).to_csv(tmp_path / "own.csv", index=False)
    assert made(tmp_path / "a", tmp_path / "own.csv", *BORE)["P"].to_numpy() == pytest.approx(P)


def test_force_pressure_and_size_are_held_against_each_other(tmp_path, capsys):
    log = cylinder(tmp_path, force_unit=10)
    assert main(["init", str(log), *BORE, "--out", str(tmp_path / "a")]) == 0
    assert "times smaller than pressure and size make it" in capsys.readouterr().err
    log.write_text(log.read_text().replace("Kraft [N]", "Kraft"))
    assert main(["init", str(log), *BORE, "--out", str(tmp_path / "b")]) == 2
    assert "the unit of F is only assumed" in capsys.readouterr().err
    log.write_text(log.read_text().replace("Kraft", "Kraft [daN]"))
    assert made(tmp_path / "b", log, *BORE)["F"].max() == pytest.approx(104.9, abs=1.0)


# --- runs, files, constants -------------------------------------------------------------------------------------
def test_the_column_of_runs_is_found(tmp_path, capsys):
    log = pd.read_csv(cylinder(tmp_path), sep=";", decimal=",")
    log["Zeit [s]"] %= 1.0
    log["Messung"] = np.repeat([1, 2, 3], 100)
    log.to_csv(tmp_path / "runs.csv", index=False)
    assert made(tmp_path / "a", tmp_path / "runs.csv", *BORE)["trajectory"].nunique() == 3
    log.rename(columns={"Messung": "Nr"}).to_csv(tmp_path / "runs.csv", index=False)  # it changes where time goes back
    assert made(tmp_path / "b", tmp_path / "runs.csv", *BORE)["trajectory"].nunique() == 3
    log.drop(columns="Messung").to_csv(tmp_path / "runs.csv", index=False)
    assert made(tmp_path / "c", tmp_path / "runs.csv", *BORE)["trajectory"].nunique() == 3
    log.loc[150, "Zeit [s]"] = 0.1
    log.rename(columns={"Messung": "Nr"}).to_csv(tmp_path / "runs.csv", index=False)
    assert main(["init", str(tmp_path / "runs.csv"), *BORE, "--out", str(tmp_path / "d")]) == 2
    assert "--signal trajectory=Nr" in capsys.readouterr().err


def test_a_muscle_held_at_another_length_in_each_file(tmp_path, capsys):
    logs = []
    for name, eps in (("unkinked", 0.0), ("kinked25", 0.05)):
        table = {"t [s]": TIME, "p [kPa]": 100 * (BAR - 2), "F [N]": 60 * (BAR - 2) * (1 - 4 * eps)}
        pd.DataFrame(table).to_csv(tmp_path / f"{name}.csv", index=False)
        logs.append(str(tmp_path / f"{name}.csv"))
    argv = ["init", *logs, "--kind", "muscle", "--set", "rest_length=20 cm", "--set", "rest_diameter=10 mm", "--yes"]
    assert main([*argv, "--out", str(tmp_path / "a")]) == 2
    assert "--constant 'length=17.45 cm@*25*'" in capsys.readouterr().err
    held = ["--constant", "length=20 cm@*unkinked*", "--constant", "length=19 cm@*kinked25*"]
    assert main([*argv, *held, "--out", str(tmp_path / "a")]) == 0
    log = read_log(logs, tmp_path / "a" / "columns.toml")
    assert log.groupby("trajectory")["eps"].first().round(4).to_dict() == {"kinked25": 0.05, "unkinked": 0.0}


def test_ranges_are_those_of_all_runs_and_overrides_are_shown(tmp_path, capsys):
    for k in (1, 2):
        pd.DataFrame({"t [s]": TIME, "a": k * BAR, "Hub [mm]": BAR, "Kraft [N]": BAR}).to_csv(
            tmp_path / f"{k}.csv", index=False
        )
    argv = ["init", str(tmp_path / "1.csv"), str(tmp_path / "2.csv"), *BORE[:2], "--yes", "--out", str(tmp_path / "a")]
    assert main([*argv, "--signal", "P=a:bar:absolute"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("a "))
    assert row.split() == ["a", "2", "8", "P", "bar", "absolute", "given"]


def test_a_joint_without_a_drive_is_refused(tmp_path, capsys):
    pd.DataFrame({"t [s]": TIME, "angle [deg]": 30 * np.sin(TIME)}).to_csv(tmp_path / "joint.csv", index=False)
    assert main(["init", str(tmp_path / "joint.csv"), "--kind", "joint", "--yes", "--out", str(tmp_path / "a")]) == 2
    assert "--signal drive=COLUMN" in capsys.readouterr().err


# --- refusing ---------------------------------------------------------------------------------------------------
def test_nothing_is_overwritten_unless_forced(muscle, tmp_path, capsys):
    argv = ["init", str(muscle), "--kind", "muscle", "--yes", "--out", str(tmp_path / "a")]
    assert main(argv) == 0
    before = (tmp_path / "a" / "sim.toml").read_text()
    assert main([*argv, "--set", "rest_length=0.3"]) == 2
    assert "--force" in capsys.readouterr().err
    assert (tmp_path / "a" / "sim.toml").read_text() == before
    assert main([*argv, "--set", "rest_length=0.3", "--force"]) == 0
    assert read_system(tmp_path / "a" / "sim.toml").values["rest_length"] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--kind", "sofa"], "no kind 'sofa'"),
        (["--kind", "muscle", "--set", "bore=3"], "not a parameter of a muscle"),
        (["--kind", "muscle", "--set", "rest_length=200"], "200 mm is 0.2"),
        (["--kind", "muscle", "--set", "rest_length"], "name=value"),
        (["--kind", "muscle", "--signal", "P"], "signal=column:unit"),
        (["--kind", "muscle", "--signal", "P=sofa"], "no column 'sofa'"),
        (["--kind", "muscle", "--signal", "P=pressure [bar]:mm"], "unit of length"),
        (["--kind", "muscle", "--signal", "P=pressure [bar]*x"], "factor 'x'"),
        (["--kind", "bench", "--set", "sofa=1"], "not a parameter of the bench"),
        (["--kind", "bench"], "(joint angle)"),
    ],
)
def test_what_cannot_be_is_explained(argv, words, muscle, tmp_path, capsys):
    assert main(["init", str(muscle), *argv, "--yes", "--out", str(tmp_path / "a")]) == 2
    err = capsys.readouterr().err
    assert words in err
    assert err.endswith("See docs/first_hour.md#describe-it.\n")
    assert not (tmp_path / "a").exists()


def test_a_disk_that_is_full_leaves_no_half(muscle, tmp_path, monkeypatch, capsys):
    import pamid.cli._drafting as command

    whole = command.write_whole

    def full(path, data):
        if path.name == "sim.toml":
            raise command.OutputError(f"{path} cannot be written: no space.", "space", "Make room.")
        return whole(path, data)

    monkeypatch.setattr(command, "write_whole", full)
    assert main(["init", str(muscle), "--kind", "muscle", "--yes", "--out", str(tmp_path / "a")]) == 2
    assert "no space" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()
    assert not list(tmp_path.glob(".pamid*"))


# --- asking -----------------------------------------------------------------------------------------------------
def test_questions_on_a_terminal(nameless, tmp_path, monkeypatch, capsys):
    answers = ["sofa", "cylinder", "1:mm", "99", "2:bar", "3:N", "ms", "25", "25 mm"]
    monkeypatch.setattr("sys.stdin", Terminal("\n".join(answers) + "\n"))
    assert main(["init", str(nameless), "--out", str(tmp_path / "a")]) == 0
    err = capsys.readouterr().err
    assert "What was recorded?" in err
    assert "no column '99'" in err or "position from 0 to 3" in err
    assert "25 mm is 0.025" in err
    log = read_log(nameless, tmp_path / "a" / "columns.toml")
    assert log["P"].max() == pytest.approx(501_325, abs=200)  # the force vanishes with the reading: gauge
    assert read_system(tmp_path / "a" / "sim.toml").values["bore"] == pytest.approx(0.025)


def test_an_input_that_ends_takes_the_defaults(muscle, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.stdin", Terminal(""))
    assert main(["init", str(muscle), "--kind", "muscle", "--out", str(tmp_path / "a"), "--quiet"]) == 0
    assert "ASSUMED" in (tmp_path / "a" / "sim.toml").read_text()


@pytest.mark.parametrize("name", ["Longueur (mm)", "laser [mm]", "dist_mm", "x [mm]"])
def test_a_position_near_a_muscles_own_length_is_a_length(name, tmp_path, capsys):
    t = np.arange(0, 10, 0.01)
    length = 180 - 20 * np.sin(t)
    for values, source in ((length, "length"), (200 - length, "shortening")):
        table = {"t [s]": t, "p [bar]": 3 + np.sin(1.7 * t), name: values, "F [N]": 200 + 50 * np.sin(1.7 * t)}
        pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
        numbers = ["--set", "rest_length=200 mm", "--set", "rest_diameter=20 mm", "--assume", "gauge", "--yes"]
        argv = ["init", str(tmp_path / "log.csv"), "--kind", "muscle", *numbers, "--out", str(tmp_path / source)]
        assert main([*argv, "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said["signals"]["eps"]["source"] == source
        assert ("eps" in said["assumed"].get("signals", {})) == (source == "length")
        assert all("turn" not in doubt for doubt in said["doubts"])


def test_an_encoding_that_is_given_stands_in_the_mapping(tmp_path):
    t = np.arange(0, 5, 0.01)
    table = {
        "時間 [s]": t,
        "壓力 [bar]": 3 + np.sin(t),
        "長度 [mm]": 180 - 10 * np.sin(t),
        "力 [N]": 100 + 30 * np.sin(t),
    }
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False, encoding="big5")
    signals = [x for s in ("time=0:s", "P=1:bar", "length=2:mm", "F=3:N") for x in ("--signal", s)]
    given = ["--kind", "muscle", "--encoding", "big5", "--yes", "--out", str(tmp_path / "a")]
    assert main(["init", str(tmp_path / "log.csv"), *signals, *given]) == 0
    mapping = tmp_path / "a" / "columns.toml"
    assert 'encoding = "big5"' in mapping.read_text() and "長度 [mm]" in mapping.read_text()
    assert read_log(tmp_path / "log.csv", mapping)["F"].max() == pytest.approx(130, abs=0.1)


def test_a_shortening_in_per_cent_is_a_contraction_ratio(tmp_path):
    t = np.arange(0, 5, 0.01)
    table = {"t": t, "p": 3e5 + 1e5 * np.sin(t), "c": 5 + 5 * np.sin(t), "f": 100 + 30 * np.sin(t)}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    signals = [x for s in ("time=t:s", "P=p:Pa:absolute", "shortening=c:%", "F=f:N") for x in ("--signal", s)]
    given = ["--kind", "muscle", "--yes", "--out", str(tmp_path / "a")]
    assert main(["init", str(tmp_path / "log.csv"), *signals, *given]) == 0
    assert read_log(tmp_path / "log.csv", tmp_path / "a" / "columns.toml")["eps"].max() == pytest.approx(0.1, abs=1e-3)

"""``pamid diagnose``: what it writes and says, and what it makes of input that is not as it should be."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, simulate
from pamid.bench.references import sine, step, triangle
from pamid.cli import main
from pamid.gap.diagnosis.result import VERDICTS
from pamid.signals import write_log

FRICTION = ("coulomb_friction", {"amplitude": 8.0, "presliding": 5e-4})
QUICK = ["--effects", "coulomb_friction,viscous_friction,leakage"]
FILES = ["corrected.toml", "diagnosis.json", "logs.parquet", "report.html", "state.json"]


@pytest.fixture(scope="module")
def bench(tmp_path_factory) -> Path:
    """A folder with a log whose muscles rub, and the simulator that knows nothing of it."""
    folder = tmp_path_factory.mktemp("bench")
    nominal = BenchParameters.for_muscle("B")
    runs = [sine(4, 15, 1600), sine(10, 8, 900), triangle(4, 20, 1600), triangle(2, 10, 1600), step(0, 12, 900)]
    write_log(simulate(nominal.replace(effects=(FRICTION,)), runs, seed=0), folder / "log.parquet")
    nominal.to_toml(folder / "log.sim.toml")
    return folder


@pytest.fixture(scope="module")
def log(bench) -> pd.DataFrame:
    return pd.read_parquet(bench / "log.parquet")


def diagnosed(folder: Path, log: pd.DataFrame | Path, sim: BenchParameters | Path, capsys, *options: str) -> dict:
    """Diagnose a log from the command line and return what it wrote; everything that a reader must be told is there."""
    if isinstance(log, pd.DataFrame):
        write_log(log, folder / "log.parquet")
        log = folder / "log.parquet"
    if isinstance(sim, BenchParameters):
        sim.to_toml(folder / "sim.toml")
        sim = folder / "sim.toml"
    out = folder / "out"
    code = main(["diagnose", str(log), "--sim", str(sim), "--out", str(out), *QUICK, *options])
    printed = capsys.readouterr()
    assert code == 0, printed.err
    assert sorted(p.name for p in out.iterdir()) == FILES
    found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    check_schema(found)
    BenchParameters.from_toml(out / "corrected.toml")
    return {**found, "printed": printed.out}


def check_schema(found: dict) -> None:
    assert found["schema"] == 1
    assert found["verdict"] in VERDICTS
    assert found["gap"] is (found["verdict"] != "none")
    assert sum(c["confidence"] for c in found["candidates"]) == pytest.approx(1.0, abs=1e-6)
    assert {"none", "unknown"} <= {c["effect"] for c in found["candidates"]}
    assert set(found["where"]) == {"equations", "regions", "bands", "trajectories", "events"}
    for part in ("causes", "closure", "notes"):
        assert isinstance(found[part], list)


def refused(argv: list[str], words: str, capsys) -> None:
    """The command ends with one clear line and leaves nothing behind."""
    code = main(["diagnose", *argv])
    err = capsys.readouterr().err
    assert code == 2, err
    assert "Traceback" not in err
    assert re.search(words, err), err


# --- what it does -------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def friction(bench, tmp_path_factory) -> tuple[Path, str]:
    import contextlib
    import io

    out = tmp_path_factory.mktemp("diagnosis") / "out"
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        assert main(["diagnose", str(bench / "log.parquet"), "--out", str(out), *QUICK, "--quiet"]) == 0
    return out, said.getvalue()


def test_friction_is_found_told_and_written(friction):
    out, said = friction
    assert sorted(p.name for p in out.iterdir()) == FILES
    found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    check_schema(found)
    assert found["gap"] is True
    assert found["where"]["equations"][0]["equation"] == "force"
    assert "coulomb_friction" in [name for cause in found["causes"] for name in cause["effects"]]
    for words in ("where ", "which ", "how far ", "candidate", "coulomb_friction", "report.html"):
        assert words in said
    assert "Coulomb friction" in (out / "report.html").read_text(encoding="utf-8")


def test_the_corrected_simulator_holds_on_another_log(friction, bench, tmp_path, capsys):
    out, _ = friction
    true = BenchParameters.for_muscle("B").replace(effects=(FRICTION,))
    write_log(simulate(true, [triangle(3, 12, 1500), sine(6, 10, 1200)], seed=5), tmp_path / "other.parquet")
    rmse = []
    for sim in (bench / "log.sim.toml", out / "corrected.toml"):
        assert main(["evaluate", str(tmp_path / "other.parquet"), "--sim", str(sim), "--json"]) == 0
        rmse.append(json.loads(capsys.readouterr().out)["equations"]["force"]["rmse"])
    assert rmse[1] < 0.3 * rmse[0]


def test_json_prints_the_diagnosis_alone(bench, tmp_path, capsys, plain_page):
    argv = ["diagnose", str(bench / "log.parquet"), "--out", str(tmp_path / "out"), *QUICK, "--json", "--quiet"]
    assert main(argv) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert printed.err == ""
    written = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert {k: v for k, v in found.items() if k != "files"} == written
    assert sorted(found["files"]) == FILES


def test_an_effect_left_out_is_not_named(bench, tmp_path, capsys, plain_page):
    options = ["--without", "coulomb_friction,leakage"]
    found = diagnosed(tmp_path, bench / "log.parquet", bench / "log.sim.toml", capsys, *options)
    assert {c["effect"] for c in found["candidates"]} == {"viscous_friction", "none", "unknown"}


# --- files --------------------------------------------------------------------------------------------------
def test_wrong_options_are_answered_before_anything_is_read(bench, tmp_path, capsys):
    log, out = str(bench / "log.parquet"), str(tmp_path / "out")
    refused([log, "--out", out, "--effects", "coulomb"], "Did you mean coulomb_friction", capsys)
    refused([log, "--out", out, "--without", "leek"], "--without names 'leek'", capsys)
    refused([log, "--out", out, "--effects", "leakage", "--without", "leakage"], "No effect is left", capsys)
    refused([log, "--out", str(tmp_path / "a" / "b")], "does not exist", capsys)
    refused([log, "--out", str(bench / "log.parquet")], "is a file", capsys)
    refused([str(tmp_path / "no.parquet"), "--out", out], "no.parquet", capsys)
    assert not list(tmp_path.iterdir())


def test_without_a_simulator_it_asks_for_one(log, tmp_path, capsys):
    write_log(log, tmp_path / "alone.parquet")
    refused([str(tmp_path / "alone.parquet"), "--out", str(tmp_path / "out")], "--sim SIM.toml", capsys)


@pytest.fixture
def plain_page(monkeypatch):
    """The page has tests of its own; here it only costs time."""
    monkeypatch.setattr("pamid.report.page.report_html", lambda *_: "the page")


@pytest.mark.parametrize("new", [True, False])
def test_all_files_are_written_or_none(log, tmp_path, monkeypatch, plain_page, new):
    from pamid.cli.commands.diagnose import write
    from pamid.errors import OutputError
    from pamid.gap import diagnose
    from pamid.report.sections import Source

    d = diagnose(log, BenchParameters.for_muscle("B"), ["leakage"])
    out = tmp_path / "out"
    if not new:
        out.mkdir()
        for name in FILES:
            (out / name).write_text("as before")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.rename" if new else "pathlib.Path.replace", full)
    with pytest.raises(OutputError, match="No space left"):
        write(d, out, Source())
    assert [p.name for p in tmp_path.iterdir()] == ([] if new else ["out"])
    if not new:
        assert sorted(p.name for p in out.iterdir()) == FILES
        assert all((out / name).read_text() == "as before" for name in FILES)


# --- input that is not as it should be ----------------------------------------------------------------------
def test_no_tolerances_and_no_repeats(log, tmp_path, capsys, plain_page):
    exact = BenchParameters.for_muscle("B").replace(tolerance={})
    found = diagnosed(tmp_path, log, exact, capsys)
    assert re.search("noise", " ".join(found["notes"])), "it says what the noise floor rests on"
    assert "note" in found["printed"]


def test_a_single_trajectory(log, tmp_path, capsys):
    found = diagnosed(tmp_path, log[log["trajectory"] == "sine-4-15"], BenchParameters.for_muscle("B"), capsys)
    assert re.search("traject|run", " ".join(found["notes"])), "it says that intervals over one run are meaningless"


@pytest.mark.parametrize(("missing", "lost"), [("F", {"force", "joint"}), ("mdot", {"flow", "valve"})])
def test_missing_columns_are_named_with_what_they_cost(log, tmp_path, capsys, missing, lost):
    short = log.drop(columns=[f"{missing}1", f"{missing}2"])
    found = diagnosed(tmp_path, short, BenchParameters.for_muscle("B"), capsys)
    assert not lost & {e["equation"] for e in found["where"]["equations"]}
    assert f"{missing}1" in " ".join(found["notes"])
    assert f"{missing}1" in found["printed"]


def test_gaps_of_nan(log, tmp_path, capsys, plain_page):
    holed = log.copy()
    for start in range(100, len(log) - 60, 900):
        holed.iloc[start : start + 40, holed.columns.get_indexer(["F1", "P2"])] = np.nan
    found = diagnosed(tmp_path, holed, BenchParameters.for_muscle("B"), capsys)
    assert found["where"]["equations"][0]["equation"] == "force"
    assert "missing value" in " ".join(found["notes"])


def test_mixed_sampling_rates(log, tmp_path, capsys, plain_page):
    slow = log["trajectory"] == "triangle-2-10"
    mixed = pd.concat([log[~slow], log[slow].iloc[::2]])
    found = diagnosed(tmp_path, mixed, BenchParameters.for_muscle("B"), capsys)
    assert found["where"]["equations"][0]["equation"] == "force"
    assert "sampling intervals: 1 ms, 2 ms" in " ".join(found["notes"])


def test_a_log_without_what_any_equation_needs(log, tmp_path, capsys):
    BenchParameters.for_muscle("B").to_toml(tmp_path / "sim.toml")
    for name, columns in {"q": ["q"], "all": [c for c in log if re.match(r"F|mdot|P", c)]}.items():
        write_log(log.drop(columns=columns), tmp_path / f"{name}.parquet")
        argv = [str(tmp_path / f"{name}.parquet"), "--out", str(tmp_path / "out"), *QUICK]
        refused(argv, "lacks|needs", capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rest_length = 0.2", "rest_length = 200.0", "Lengths are in m"),
        ("inertia = 0.02", "inertia = nan", "inertia"),
        ("rest_diameter", "rest_diametre", "rest_diametre"),
        ("[joint]", "[joint", "not valid TOML"),
    ],
)
def test_an_implausible_simulator_is_refused(bench, tmp_path, capsys, old, new, words):
    text = (bench / "log.sim.toml").read_text()
    assert old in text
    (tmp_path / "sim.toml").write_text(text.replace(old, new, 1))
    argv = [str(bench / "log.parquet"), "--sim", str(tmp_path / "sim.toml"), "--out", str(tmp_path / "out")]
    refused(argv, words, capsys)
    assert not (tmp_path / "out").exists()


def test_names_of_runs_are_text(log, tmp_path, capsys):
    name = "<script>alert(1)</script>$x_$\x1b[31m"
    strange = log.assign(trajectory=log["trajectory"].replace("sine-4-15", name))
    found = diagnosed(tmp_path, strange, BenchParameters.for_muscle("B"), capsys)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "\x1b" not in found["printed"]


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("F1 > 1e9", "No row meets 'F1 > 1e9'"),
        ("trajectory > 1", "--where names trajectory, which holds text"),
        ("__import__('os') > 1", "COLUMN > NUMBER"),
        ("F1 > " + "9" * 400, "COLUMN > NUMBER"),
    ],
)
def test_a_condition_that_nothing_meets_or_that_is_none_is_refused(condition, words, tmp_path, capsys):
    """Else the equations that do without the reading would answer in its place."""
    bench = BenchParameters.for_muscle("B")
    simulate(bench, [sine(4, 15, 300)], seed=0).to_csv(tmp_path / "log.csv", index=False)
    bench.to_toml(tmp_path / "sim.toml")
    argv = [str(tmp_path / "log.csv"), "--sim", str(tmp_path / "sim.toml"), "--out", str(tmp_path / "out")]
    assert main(["diagnose", *argv, "--where", condition]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_equation_of_which_nothing_was_said_to_close_falls_short_of_nothing(monkeypatch):
    """A correction that makes an equation without a gap a trace worse is no less than the report says."""
    from dataclasses import replace
    from types import SimpleNamespace

    from pamid.cli._corrected import _short
    from pamid.gap import Closure

    def gap(equation, low, allowed=""):
        return Closure(equation, 1.1, 1.0, 1.0, 0.9, (low, 1.0), allowed=allowed)

    left = dict.fromkeys(("valve", "force", "told"), SimpleNamespace(rmse=1.102, unit=""))
    left["level"] = SimpleNamespace(rmse=1.102, unit="m")  # predicted now; the report judged its rate
    monkeypatch.setattr("pamid.gap.evaluation.evaluate", lambda log, simulator: left)
    said = [gap("valve", 0.0), gap("force", 0.8), gap("told", 0.8, "timing of u")]
    d = SimpleNamespace(corrected=None, closure=[*said, replace(gap("level", 0.8), unit="m/s")])
    assert _short(d, None, object()) == {"force": 0.0}


def test_hysteresis_of_the_size_that_simulate_gives_it_is_named(tmp_path: Path, capsys) -> None:
    runs = ["sine:frequency=4,amplitude=15,seconds=1.6", "triangle:frequency=4,amplitude=20,seconds=1.6",
            "sine:frequency=10,amplitude=8,seconds=1", "step:start=0,end=12,seconds=1"]  # fmt: skip
    log, out = str(tmp_path / "log.parquet"), str(tmp_path / "out")
    made = [part for run in runs for part in ("--trajectory", run)]
    assert main(["simulate", "--muscle", "B", "--effect", "hysteresis", *made, "--out", log]) == 0
    assert main(["diagnose", log, "--out", out, "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "One cause: hysteresis" in said and "amplitude 8 N" in said
    assert "less than the report says" not in said  # of flow and joint, in which there is no gap, nothing is said

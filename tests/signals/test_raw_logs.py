"""From a raw log to its evaluation, by the commands alone: every log is read right, or stopped with what to say."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from pamid import read_log
from pamid.cli import main

sys.path.append(str(Path(__file__).parent))
from raw_logs import RAW_LOGS, RawLog, table

DIAGNOSED = ("cylinder-dekanewton", "muscle-shortening", "joint-degrees")
PAGE = Path(__file__).resolve().parent / "raw_logs.md"


def init(log: RawLog, folder: Path) -> tuple[int, list[str], list[str], object]:
    files, truth = log.make(folder)
    code = main(["init", *map(str, files), *log.argv, "--yes", "--quiet", "--out", str(folder / "setup")])
    pages = ["--columns", str(folder / "setup" / "columns.toml"), "--sim", str(folder / "setup" / "sim.toml")]
    return code, [str(f) for f in files], pages, truth


@pytest.mark.parametrize("log", [r for r in RAW_LOGS if not r.stops], ids=lambda r: r.name)
def test_a_raw_log_is_read_right(log, tmp_path, capsys):
    code, files, pages, truth = init(log, tmp_path)
    assert code == 0, capsys.readouterr().err
    found = read_log(files, pages[1])
    needed = (
        {"time", "q", "P1", "P2"}
        if log.run.__name__ == "bench"
        else {"time"} | set(truth) & {"x", "eps", "P", "F", "q", "drive"}
    )
    assert needed <= set(found)
    assert found["trajectory"].nunique() == log.runs
    for signal in [s for s in found if s in truth and s != "trajectory"]:
        wanted = truth[signal].to_numpy(dtype=float)
        tolerance = 2e-3 if signal == "time" else 1e-5 * np.abs(wanted).max()  # stamps have milliseconds
        assert found[signal].to_numpy() == pytest.approx(wanted, abs=tolerance), signal
    capsys.readouterr()
    assert main(["check", *files, *pages, "--json", "--quiet"]) == 0
    surveyed = json.loads(capsys.readouterr().out)
    assert surveyed["sampling"]["runs"] == log.runs
    assert not any("atmosphere" in text or "unit of F" in text for text in surveyed["warnings"])
    if log.run.__name__ == "bench":
        return  # its numbers are not given: the error says nothing
    assert main(["evaluate", *files, *pages, "--json", "--quiet"]) == 0
    evaluated = json.loads(capsys.readouterr().out)
    ((_, error),) = evaluated["equations"].items()
    assert evaluated["doubts"] == []
    assert error["nrmse"] < 0.4  # friction is all that the nominal equation lacks


@pytest.mark.parametrize("log", [r for r in RAW_LOGS if r.stops], ids=lambda r: r.name)
def test_what_has_two_readings_is_stopped_with_the_one_thing_to_say(log, tmp_path, capsys):
    code = init(log, tmp_path)[0]
    err = capsys.readouterr().err
    assert code == 2
    assert log.stops in err
    assert err.count("pamid: error:") == 1
    assert "--" in err
    assert not (tmp_path / "setup").exists()


@pytest.mark.slow
@pytest.mark.parametrize("log", [r for r in RAW_LOGS if r.name in DIAGNOSED], ids=lambda r: r.name)
def test_the_friction_of_a_raw_log_is_diagnosed(log, tmp_path, capsys):
    _, files, pages, _ = init(log, tmp_path)
    argv = [
        "--effects",
        "coulomb_friction,viscous_friction,force_bias",
        "--out",
        str(tmp_path / "d"),
        "--json",
        "--quiet",
    ]
    capsys.readouterr()
    assert main(["diagnose", *files, *pages, *argv]) == 0
    causes = json.loads(capsys.readouterr().out)["causes"]
    assert "coulomb_friction" in causes[0]["effects"]


def test_the_page_shows_every_log():
    assert len(RAW_LOGS) >= 60
    assert len({log.name for log in RAW_LOGS}) == len(RAW_LOGS)
    if PAGE.is_file():
        assert table() in PAGE.read_text(encoding="utf-8"), (
            "put what `python tests/signals/raw_logs.py` prints into the page"
        )

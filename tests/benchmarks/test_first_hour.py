"""The benchmark of the first hour: names of drivers are matched, and printed commands run to a correction."""

from __future__ import annotations

import contextlib
import io
import shlex
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks" / "_first_hour").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks._first_hour import mapped  # noqa: E402
from benchmarks._first_hour.cases import cases  # noqa: E402
from benchmarks._first_hour.styles import OTHERS, STYLES  # noqa: E402
from benchmarks._first_hour.walk import Walk, signals, walk  # noqa: E402
from pamid.cli import main  # noqa: E402

QUICK = ("lerobot", "franka, desired qd", "g1, sdk2", "kuka rsi", "twincat", "Chinese, degrees", "Korean", "one letter")
"""Words, units by ranges, a position called ``qd``, gains beside commands, and two whose samples alone tell."""
EITHER_UNIT = ("odrive", "moteus", "vesc", "arduino")
"""Turns without a unit or a range, electrical turns, and a drive beside its set point: nothing in the log tells."""
ALL = {**STYLES, **OTHERS}
SHORT = "Python: motor, python-control"
"""The case whose commands up to the correction take a few seconds."""


def in_this_process(command: str, folder: Path, done: Walk, limit: float) -> str:
    """What a printed command prints, without the seconds that a new process takes to begin; no run is designed."""
    out, words = io.StringIO(), shlex.split(command)[1:]
    if words[0] == "next":
        return ""
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()) as err:
        done.failed = err.getvalue() if main(words) else ""
    return out.getvalue()


@pytest.mark.parametrize("style", [pytest.param(s, marks=[] if s in QUICK else [pytest.mark.slow]) for s in ALL])
def test_columns_of_a_driver_are_found_with_their_units(style: str) -> None:
    pytest.importorskip("mujoco")
    found = mapped.mapped(ALL[style])
    assert not found.unmarked
    if style in STYLES and style not in EITHER_UNIT:
        assert not found.marked and not found.missed


@pytest.mark.parametrize("case", [pytest.param(c, id=c.name, marks=pytest.mark.slow) for c in cases()])
def test_signals_of_the_twelve_are_right(case, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("fmpy")
    pytest.importorskip("control")
    case.write(tmp_path)
    found = mapped.judged(signals(case, tmp_path), case.truth)
    assert found.right == len(case.truth) and not (found.marked or found.unmarked)


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, id=c.name, marks=pytest.mark.slow if c.name == SHORT else pytest.mark.long) for c in cases()],
)
def test_printed_commands_run_to_a_correction(case, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("fmpy")
    pytest.importorskip("control")
    case.write(tmp_path)
    if case.name == SHORT:
        log = pd.read_csv(tmp_path / "log.csv")
        log.groupby("Run").head(400).to_csv(tmp_path / "log.csv", index=False)
    done = walk(case, tmp_path, ask=in_this_process if case.name == SHORT else None)
    assert done.ran, done.failed
    assert min(done.after[k] / b for k, b in done.before.items()) < 0.5

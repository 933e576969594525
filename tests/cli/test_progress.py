"""Progress of commands: how much is done, and the time left where the number of steps is known."""

from __future__ import annotations

import argparse
import re
import threading
import time
from pathlib import Path

import pytest

from pamid.cli import _progress, main
from pamid.cli._progress import ProgressLines, progress


def test_lines_say_the_time_left_once_the_number_of_steps_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 6.0, 7.0, 12.0, 20.0])
    monkeypatch.setattr(_progress.time, "monotonic", lambda: next(clock))
    said: list[str] = []
    lines = ProgressLines(said.append, "Comparing", None)
    lines("MLP")  # after 6 s
    lines.expect(4)
    lines("MLP")  # too soon for another line
    lines("StaticPIHM")
    lines("StaticPIHM")
    assert said == [
        "Comparing MLP (6 s)",
        "Comparing StaticPIHM (12 s, about 4 s left)",
        "Comparing StaticPIHM (20 s, about 0 s left)",
    ]


def test_quiet_shows_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress(argparse.Namespace(quiet=True), "Comparing") as step:
        step.expect(3)
        step("MLP")
    assert capsys.readouterr() == ("", "")


def test_a_terminal_gets_a_bar_with_the_time_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    with progress(argparse.Namespace(quiet=False), "Comparing") as step:
        assert isinstance(step, _progress.ProgressBar)
        step.expect(2)
        step("MLP")
        assert step.bar.tasks[0].total == 2 and step.bar.tasks[0].completed == 1
        assert any("TimeRemaining" in type(column).__name__ for column in step.bar.columns)


def test_a_step_that_takes_long_is_told_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 2.9, 3.1, 4.0, 9.0, 14.5, 19.0, 24.0, 40.0])
    monkeypatch.setattr(_progress.time, "monotonic", lambda: next(clock))
    said: list[str] = []
    lines = ProgressLines(said.append, "Fitting MLP", 4)
    lines.still()  # after 2.9 s: many commands are done by then
    lines.still()
    lines("held-out fold 1 of 3")  # after 4 s
    lines.still()  # after 9 s
    lines.still()  # after 14.5 s: 3 steps of 4 s ahead, of which 10.5 s have gone
    lines("held-out fold 2 of 3")  # after 19 s, too soon for another line
    lines.still()  # too soon, too
    lines.still()  # after 40 s: longer than both folds together
    assert said == [
        "Fitting MLP (3 s)",
        "Fitting MLP held-out fold 1 of 3 (14 s, about 2 s left)",
        "Fitting MLP held-out fold 2 of 3 (40 s)",
    ]


def test_lines_go_on_while_nothing_is_heard_of_the_work(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(_progress, "_FIRST", 0.5)
    before = set(threading.enumerate())  # others may end meanwhile
    with progress(argparse.Namespace(quiet=False), "Fitting MLP"):
        (own,) = set(threading.enumerate()) - before
        time.sleep(1.6)
    assert "pamid: Fitting MLP (1 s)" in capsys.readouterr().err
    own.join(10.0)
    assert not own.is_alive()


def test_a_fit_says_how_long_its_folds_and_itself_take(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(_progress, "_EVERY", 0.0)
    runs = [f"sine:frequency={f},amplitude=15,seconds=0.5" for f in (4, 6, 8)]
    words = [word for run in runs for word in ("--trajectory", run)]
    log = str(tmp_path / "log.parquet")
    assert main(["simulate", "--muscle", "B", *words, "--out", log, "--quiet"]) == 0
    simulator = str(tmp_path / "log.sim.toml")
    fit = ["fit", log, "--estimator", "GeometricForce", "--sim", simulator, "--out", str(tmp_path / "model.pamid")]
    assert main(fit) == 0
    line = r"Fitting GeometricForce held-out fold (\d) of 3 \(\d+ s, about \d+ s left\)"
    said = re.findall(line, capsys.readouterr().err)
    assert said == ["1", "2", "3"]

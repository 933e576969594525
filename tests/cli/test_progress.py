"""Progress of commands: how much is done, and the time left where the number of steps is known."""

from __future__ import annotations

import argparse

import pytest

from pamid.cli import _progress
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

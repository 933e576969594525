"""Progress of a command on standard error, with the time left where the number of steps is known."""

import argparse
import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

_EVERY = 5.0  # s between two lines of progress
_FIRST = 3.0  # s after which a command says what it does
_SILENT = 10.0  # s without a line, after which one says that the command still works


class Silent:
    """Progress that nobody wants to see."""

    def __call__(self, text: str = "") -> None:
        """Show nothing."""

    def expect(self, total: int) -> None:
        """Do nothing with the number of steps."""


class ProgressLines(Silent):
    """Progress where no bar can be drawn: a line every few seconds, with the time left."""

    def __init__(self, say: Callable[[str], None], what: str, total: int | None) -> None:
        self.say, self.what, self.total, self.done = say, what, total, 0
        self.last, self.patience = "", _FIRST
        self.began = self.told = self.stepped = time.monotonic()

    def __call__(self, text: str = "") -> None:
        """Count a step, and say so if the last line is some seconds old."""
        self.done += 1
        self.stepped = now = time.monotonic()
        if _is_answer(text):
            self.say(f"so far ({now - self.began:.0f} s): {text}")
            return
        self.last = text
        if now - self.told < _EVERY:
            return
        self.told, spent, self.patience = now, now - self.began, _SILENT
        ahead = max(0, self.total - self.done) if self.total else 0
        left = f", about {spent / self.done * ahead:.0f} s left" if self.total else ""
        self.say(f"{self.what} {text}".rstrip() + f" ({spent:.0f} s{left})")

    def still(self) -> None:
        """Say that a long step goes on, if the last line is old."""
        now = time.monotonic()
        if now - self.told < self.patience:
            return
        self.patience = _SILENT
        self.told, spent, left = now, now - self.began, ""
        if self.total and self.done:
            ahead = (self.stepped - self.began) / self.done * (self.total - self.done) - (now - self.stepped)
            left = f", about {ahead:.0f} s left" if ahead > 0.0 else ""
        self.say(f"{self.what} {self.last}".rstrip() + f" ({spent:.0f} s{left})")

    def expect(self, total: int) -> None:
        """Set the number of steps."""
        self.total = total


class ProgressBar(Silent):
    """Progress on a terminal: a bar, with the time left where the number of steps is known."""

    def __init__(self, bar: Any, what: str, total: int | None) -> None:
        self.bar, self.what = bar, what
        self.task = bar.add_task(what, total=total)

    def __call__(self, text: str = "") -> None:
        """Count a step; an answer so far stays above the bar."""
        if _is_answer(text):
            spent = self.bar.tasks[self.task].elapsed or 0.0
            self.bar.console.print(f"pamid: so far ({spent:.0f} s): {text}", markup=False)
            return
        self.bar.update(self.task, advance=1, description=f"{self.what} {text}".rstrip())

    def expect(self, total: int) -> None:
        """Set the number of steps."""
        self.bar.update(self.task, total=total)


def _is_answer(text: str) -> bool:
    """Return whether a text of progress is an answer so far, which stays."""
    if type(text) is str:  # most steps are, and need no diagnosis to be loaded
        return False
    from ..gap.inference.so_far import SoFar

    return isinstance(text, SoFar)


@contextlib.contextmanager
def _kept_up(lines: ProgressLines) -> Iterator[None]:
    """Print lines during a long step, such as a fit."""
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(1.0):
            lines.still()

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        ended.set()


@contextlib.contextmanager
def progress(args: argparse.Namespace, what: str, total: int | None = None) -> Iterator[Silent]:
    """Show on standard error how far the body is: a bar on a terminal, elsewhere a line every few seconds."""
    from .common import note

    if args.quiet:
        yield Silent()
        return
    if not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        lines = ProgressLines(lambda text: note(args, text), what, total)
        with _kept_up(lines):
            yield lines
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    left = [TimeElapsedColumn(), TextColumn("left:"), TimeRemainingColumn()]
    columns = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), *left]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield ProgressBar(bar, what, total)

"""Samples as they come: JSON lines from a pipe or a growing file, checked, with rates, in blocks."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..errors import LogNotFoundError, ParameterError, StreamError

HALF_WIDTH = 10
"""Samples on either side of the one whose rate is estimated; results come that much later than samples."""

LONGEST_LINE = 1 << 20
"""Bytes after which a line without an end is given up."""

RESTART = 1.0
"""Seconds by which time goes back that make it a restarted stream rather than a late sample."""

_RATES = {"deps": "eps", "dP": "P"}


def slope_weights(interval: float) -> np.ndarray:
    """Return what `numpy.convolve` turns samples into their rates with, 1/s, from `HALF_WIDTH` on either side."""
    n = HALF_WIDTH
    # The slope of a parabola through 2 n + 1 samples is that of a straight line.
    return np.arange(n, -n - 1, -1) / (n * (n + 1) * (2 * n + 1) / 3.0) / interval


def lines(
    path: str | Path, *, follow: bool = False, poll: float = 0.1, patience: float | None = None
) -> Iterator[bytes]:
    """Yield the complete lines of a file, and of what is appended to it.

    A line that is still being written is not read until its end is there. A file that has become shorter is read anew.

    Parameters
    ----------
    path : path-like
        The file.
    follow : bool, default=False
        Whether to wait for more at its end.
    poll : float, default=0.1
        Seconds between looks.
    patience : float, optional
        Seconds without news after which following ends; without end by default.

    Raises
    ------
    LogNotFoundError
        There is no such file.
    StreamError
        A line is longer than any sample.
    """
    path = Path(path)
    if not path.is_file():
        raise LogNotFoundError(f"There is no file {path}.", "a file of JSON lines", "Correct the path; '-' is a pipe.")
    position, rest, quiet = 0, b"", 0.0
    while True:
        if path.stat().st_size < position:
            position, rest = 0, b""
        with path.open("rb") as stream:
            stream.seek(position)
            news = stream.read(1 << 20)
        if news:
            position, quiet = position + len(news), 0.0
            *whole, rest = (rest + news).split(b"\n")
            yield from whole
            if len(rest) > LONGEST_LINE:
                raise StreamError(f"A line of {path} has no end after {len(rest)} bytes.", "JSON lines", "Check it.")
            continue
        if not follow or (patience is not None and quiet >= patience):
            if rest and not follow:
                yield rest
            return
        time.sleep(poll)
        quiet += poll


def pipe_lines(stream: IO[bytes]) -> Iterator[bytes]:
    """Yield the lines of a pipe as they come."""
    while line := stream.readline(LONGEST_LINE):
        if len(line) >= LONGEST_LINE:
            raise StreamError(f"A line has no end after {LONGEST_LINE} bytes.", "JSON lines", "Check the pipe.")
        yield line.rstrip(b"\n")


class Samples:
    """Turn lines into blocks of evenly spaced samples with rates.

    Parameters
    ----------
    columns : sequence of str
        Signals that are read; ``eps`` and ``P`` must be among them. One that a sample lacks is NaN.
    interval : float, default=0.001
        Sampling interval, s.
    block : int, default=100
        Samples a block.

    Attributes
    ----------
    problems : dict of str to int
        How often each kind of bad input was met: ``"malformed"``, ``"late"``, ``"gap"``, ``"restart"``, ``"missing"``.
    last_problem : str
        The last malformed line, in words.
    """

    def __init__(self, columns: Sequence[str], *, interval: float = 1e-3, block: int = 100) -> None:
        if not interval > 0 or block < 1:
            raise ParameterError(f"interval={interval!r}, block={block!r}.", "positive numbers", "Correct them.")
        self.columns = tuple(columns)
        self.interval = interval
        self.block = block
        self.problems = dict.fromkeys(("malformed", "late", "gap", "restart", "missing"), 0)
        self.last_problem = ""
        self._rows: list[list[float]] = []
        self._last = -math.inf
        self._begins = True
        self._slope = slope_weights(interval)

    def take(self, line: bytes) -> list[tuple[bool, dict[str, np.ndarray]]]:
        """Take a line and return the blocks that it completes, each with whether a new run begins with it."""
        row = self._parse(line)
        if row is None:
            return []
        now, out = row[0], []
        step = now - self._last
        if step < 0.5 * self.interval:
            if step > -RESTART:
                self.problems["late"] += 1
                return []
            self.problems["restart"] += 1
        elif math.isfinite(self._last) and step > 1.5 * self.interval:
            self.problems["gap"] += 1
        if not math.isfinite(self._last) or step < 0 or step > 1.5 * self.interval:
            out += self._cut(whole=True)
            self._rows, self._begins = [], True
        self._last = now
        self._rows.append(row)
        return out + (self._cut() if len(self._rows) >= self.block + 2 * HALF_WIDTH else [])

    def end(self) -> list[tuple[bool, dict[str, np.ndarray]]]:
        """Return what is left at the end of the stream."""
        out = self._cut(whole=True)
        self._rows = []
        return out

    def _cut(self, whole: bool = False) -> list[tuple[bool, dict[str, np.ndarray]]]:
        n = HALF_WIDTH
        if len(self._rows) <= 2 * n or (not whole and len(self._rows) < self.block + 2 * n):
            return []
        data = np.array(self._rows, dtype=float)
        table = {"time": data[n:-n, 0]}
        for k, name in enumerate(self.columns, 1):
            table[name] = data[n:-n, k]
        for rate, name in _RATES.items():
            table[rate] = np.convolve(data[:, 1 + self.columns.index(name)], self._slope, mode="valid")
        begins, self._begins = self._begins, False
        self._rows = self._rows[-2 * n :]
        return [(begins, table)]

    def _parse(self, line: bytes) -> list[float] | None:
        text = line.strip()
        if not text:
            return None
        try:
            found = json.loads(text)
            if not isinstance(found, dict):
                raise ValueError(f"a {type(found).__name__} instead of an object")
            row = [_number(found.get("time"), "time"), *(_number(found.get(c), c) for c in self.columns)]
            if not math.isfinite(row[0]):
                raise ValueError("no time")
        except (ValueError, RecursionError) as error:
            self.problems["malformed"] += 1
            shown = text[:60].decode("utf-8", "replace")
            self.last_problem = f"{shown!r}: {str(error)[:80]}"
            return None
        if any(math.isnan(v) for v in row):
            self.problems["missing"] += 1
        return row


def _number(value: Any, name: str) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{name} is {value!r:.30}, not a number")
    return float(value) if math.isfinite(value) else math.nan


__all__ = ["Samples", "lines", "pipe_lines", "slope_weights"]

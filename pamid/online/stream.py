"""Samples as they come: JSON lines checked, put on an even clock, with rates, in blocks."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import ParameterError
from .lines import LONGEST_LINE, lines, pipe_lines

HALF_WIDTH = 10
"""Samples on either side of the one whose rate is estimated; results come that much later than samples."""

RESTART = 1.0
"""Seconds by which time goes back that make it a restarted stream rather than a late sample."""

STEPS = 50
"""Steps of time from which the interval is found."""

HOLE = HALF_WIDTH + 0.5
"""Intervals across which lost samples are filled by a straight line: no more than half the window of the rates."""

EVEN = 0.02
"""Share of the interval within which a step is an even one; its sample is then taken as it is."""

GLITCH = 10.0
"""Multiple of the 90 % quantile of the curvature above which a single sample is a glitch."""

_RATES = {"deps": "eps", "dP": "P"}

Row = list[float]
Block = tuple[bool, dict[str, np.ndarray]]


def slope_weights(interval: float) -> np.ndarray:
    """Return the kernel for rates by `numpy.convolve`, 1/s, over `HALF_WIDTH` samples on either side."""
    n = HALF_WIDTH
    # The slope of a parabola through 2 n + 1 samples is that of a straight line.
    return np.arange(n, -n - 1, -1) / (n * (n + 1) * (2 * n + 1) / 3.0) / interval


class Samples:
    """Turn lines into evenly spaced blocks of columns and the rates of ``eps`` and ``P``; `problems` counts bad input.

    Uneven and few lost samples are interpolated, a longer hole begins a new run, a single outlier is replaced.
    `convert` may raise ValueError, TypeError or KeyError for a malformed line.
    """

    def __init__(
        self,
        columns: Sequence[str],
        *,
        interval: float | None = None,
        block: int = 100,
        convert: Callable[[dict[str, Any]], Mapping[str, Any]] | None = None,
    ) -> None:
        if (interval is not None and not 0 < interval < math.inf) or block < 1:
            raise ParameterError(f"interval={interval!r}, block={block!r}.", "positive numbers", "Correct them.")
        self.columns = tuple(columns)
        self._rates = {rate: name for rate, name in _RATES.items() if name in self.columns}
        self.interval = interval
        self.block = block
        self.convert = convert
        kinds = ("malformed", "late", "gap", "restart", "missing", "lost", "glitch")
        self.problems = dict.fromkeys(kinds, 0)
        self.first_problem = self.last_problem = ""
        self.objects = 0
        """Lines that hold a JSON object."""
        self._waiting: list[Row] = []
        self._rows: list[Row] = []
        self._last: Row | None = None
        self._begins = True

    def take(self, line: bytes) -> list[Block]:
        """Take a line and return the blocks that it completes, each with whether a new run begins with it."""
        row = self._parse(line)
        if row is None:
            return []
        if self.interval is not None:
            return self._follow(row)
        if self._waiting and 0 >= row[0] - self._waiting[-1][0] > -RESTART:
            self.problems["late"] += 1
            return []
        self._waiting.append(row)
        steps = np.diff([r[0] for r in self._waiting])
        forward = steps[steps > 0]
        if len(forward) < STEPS:
            return []
        self.interval = float(np.median(forward))
        # Clocks are set to plain numbers; a median of rounded times is not off by more than their rounding.
        plain = float(f"{self.interval:.3g}")
        self.interval = plain if abs(plain - self.interval) < 1e-3 * self.interval else self.interval
        waiting, self._waiting = self._waiting, []
        return [block for early in waiting for block in self._follow(early)]

    def end(self) -> list[Block]:
        """Return the last block, at the end of the stream."""
        out = self._cut(whole=True)
        self._rows = []
        return out

    def _follow(self, row: Row) -> list[Block]:
        """Put a sample on the even clock."""
        assert self.interval is not None
        last = self._last
        if last is None:
            self._begin(row)
            return []
        step = row[0] - last[0]
        if 0 >= step > -RESTART:
            self.problems["late"] += 1
            return []
        if step < 0 or step > HOLE * self.interval:
            self.problems["restart" if step < 0 else "gap"] += 1
            out = self.end()
            self._begin(row)
            return out
        self._last = row
        due = self._rows[-1][0] + self.interval
        if abs(row[0] - due) <= EVEN * self.interval:
            self._rows.append(row)
        else:
            self.problems["lost"] += max(0, round(step / self.interval) - 1)
            while due <= row[0] + 1e-9 * self.interval:
                share = (due - last[0]) / step
                self._rows.append([due, *(a + share * (b - a) for a, b in zip(last[1:], row[1:], strict=True))])
                due += self.interval
        return self._cut() if len(self._rows) >= self.block + 2 * HALF_WIDTH else []

    def _begin(self, row: Row) -> None:
        self._last, self._rows, self._begins = row, [row], True

    def _cut(self, whole: bool = False) -> list[Block]:
        n = HALF_WIDTH
        if len(self._rows) <= 2 * n or (not whole and len(self._rows) < self.block + 2 * n):
            return []
        assert self.interval is not None
        data = np.array(self._rows, dtype=float)
        for k in range(1, data.shape[1]):
            self.problems["glitch"] += without_glitches(data[:, k])
        for name in self._rates.values():
            _filled(data[:, 1 + self.columns.index(name)])
        table = {"time": data[n:-n, 0]}
        for k, name in enumerate(self.columns, 1):
            table[name] = data[n:-n, k]
        for rate, name in self._rates.items():
            column = data[:, 1 + self.columns.index(name)]
            table[rate] = np.convolve(column, slope_weights(self.interval), mode="valid")
        begins, self._begins = self._begins, False
        self._rows = data[-2 * n :].tolist()
        return [(begins, table)]

    def _parse(self, line: bytes) -> Row | None:
        text = line.strip()
        if not text:
            return None
        try:
            if len(text) >= LONGEST_LINE:
                raise ValueError(f"no end after {LONGEST_LINE} bytes")
            found = _object(text)
            self.objects += 1
            row = found if self.convert is None else self.convert(found)
            values = [_number(row.get("time"), "time"), *(_number(row.get(c), c) for c in self.columns)]
            if not math.isfinite(values[0]):
                raise ValueError("no time")
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError, MemoryError) as error:
            self.problems["malformed"] += 1
            shown = text[:60].decode("utf-8", "replace")
            self.last_problem = f"{shown!r}: {str(error)[:80]}"
            self.first_problem = self.first_problem or f"{shown!r}"
            return None
        if any(math.isnan(v) for v in values):
            self.problems["missing"] += 1
        return values


def _object(text: bytes) -> dict[str, Any]:
    """Return the JSON object in a line."""
    try:
        found = json.loads(text)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise ValueError("no JSON object")
    return found


def without_glitches(values: np.ndarray) -> int:
    """Replace single samples that leave their neighbours and come back by these neighbours' mean; return how many."""
    between = (values[:-2] + values[2:]) / 2.0
    bend = np.abs(values[1:-1] - between)
    known = bend[np.isfinite(bend)]
    if len(known) < 2 * HALF_WIDTH:
        return 0
    usual = float(np.quantile(known, 0.9))
    # A spike also curves its neighbours, by half as much; an edge curves two samples alike.
    beside = np.fmax(np.r_[0.0, bend[:-1]], np.r_[bend[1:], 0.0])
    floor = 1e-12 * float(np.nanmax(np.abs(values)))
    found = np.flatnonzero((bend > GLITCH * usual + floor) & (bend > 1.5 * beside))
    values[1 + found] = between[found]
    return len(found)


def _filled(values: np.ndarray) -> None:
    """Fill short holes in one signal by straight lines, in place."""
    known = np.flatnonzero(np.isfinite(values))
    if 0 < len(known) < len(values):
        for left, right in pairwise(known):
            if 1 < right - left < HOLE:
                inner = np.arange(left + 1, right)
                values[inner] = np.interp(inner, [left, right], values[[left, right]])


def _number(value: Any, name: str) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{name} is {value!r:.30}, not a number")
    return float(value) if math.isfinite(value) else math.nan


__all__ = ["Samples", "lines", "pipe_lines", "slope_weights", "without_glitches"]

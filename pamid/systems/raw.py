"""The tables of raw logs before anything is known of them, and the runs that their clocks and variables show."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..errors import ColumnTypeError
from ..signals.formats import RawTable, format_of
from ..signals.joining import is_joined, sources
from ..signals.log import MAX_BYTES
from ..signals.mapping import LogMapping

_JUMP = 20.0  # sampling intervals: a step of time this long within the first rows is the recorder, not the run
_FIRST = 0.02
_RESTART = 0.2  # of a run's length: time that falls by more than the rest of it begins again


def read_raw(paths: Sequence[Path], settings: dict[str, Any]) -> list[RawTable]:
    """Read the tables of all files; settings that only the files tell are added."""
    found: list[RawTable] = []
    mapping = LogMapping(encoding=settings.get("encoding"))
    if is_joined(paths, mapping, MAX_BYTES):
        found = [t for _, tables, _ in sources(paths, mapping, MAX_BYTES, []) for t in tables]
        paths = ()
    for path in paths:
        tables = _tables(path, settings)
        if len(tables) > 1 and path == paths[0]:
            settings |= _variables(tables)
        found += [t for t in tables if not is_zero_run(t)] or tables
    widest = max(found, key=lambda t: t.frame.shape[1])
    first = widest if widest.frame.shape[1] > found[0].frame.shape[1] else found[0]
    return [first, *(t for t in found if t is not first)]


def _tables(path: Path, settings: dict[str, Any]) -> list[RawTable]:
    """Read one file; thousands points are tried where the numbers look like it."""
    mapping = LogMapping(thousands=settings.get("thousands"), encoding=settings.get("encoding"))
    try:
        return format_of(path, mapping.encoding).read(path, mapping, MAX_BYTES)[0]
    except ColumnTypeError as error:
        mark = "." if "thousands = '.'" in error.remedy else "," if "thousands = ','" in error.remedy else ""
        if not mark or mapping.thousands:
            raise
        settings["thousands"] = mark
        return format_of(path, mapping.encoding).read(path, replace(mapping, thousands=mark), MAX_BYTES)[0]


def is_zero_run(table: RawTable) -> bool:
    """Return whether a table is the unloaded run by which sensors are zeroed."""
    return any(word in (table.variable or "").lower() for word in ("offset", "zero", "tare", "null", "tara"))


def _variables(tables: list[RawTable]) -> dict[str, Any]:
    """Return settings that take the variables of one file as runs."""
    names = [str(t.variable) for t in tables if t.variable and not is_zero_run(t)]
    found: dict[str, Any] = {}
    if len(names) == 1:
        found["trajectories"] = names[0]
    elif names:
        head, tail = _shared(names), _shared([n[::-1] for n in names])[::-1]
        found["trajectories"] = f"{head}*{tail[: max(0, min(map(len, names)) - len(head))]}"
    if zero := next((str(t.variable) for t in tables if is_zero_run(t)), ""):
        found["zero_run"] = zero
    return found


def _shared(names: Sequence[str]) -> str:
    """Return the letters that all names begin with."""
    n = next((k for k, letters in enumerate(zip(*names, strict=False)) if len(set(letters)) > 1), min(map(len, names)))
    return names[0][:n]


def clock_settings(time: np.ndarray, one_run: bool) -> dict[str, Any]:
    """Return the clock's hints at runs: rows before the recording begins, and time that begins again."""
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    found: dict[str, Any] = {}
    early = steps[: max(3, int(_FIRST * len(steps)))]
    jumps = np.flatnonzero((early > _JUMP * usual) & (usual > 0))
    if len(jumps):
        found["skip_rows"] = int(jumps[-1]) + 1
    backwards = np.flatnonzero(steps < 0)
    if one_run and len(backwards) and usual > 0:
        starts = np.concatenate([[0], backwards + 1])
        lengths = time[np.concatenate([backwards, [len(time) - 1]])] - time[starts]
        if np.all(-steps[backwards] > (1 - _RESTART) * lengths[:-1]) and np.all(lengths > 10 * usual):
            found["time_order"] = "split"
    return found


def run_columns(frame: pd.DataFrame, time: np.ndarray) -> list[str]:
    """Return the columns that change just where time goes back: they may name the runs."""
    back = np.flatnonzero(np.diff(time) < 0)
    found = []
    for k, name in enumerate(frame.columns):
        values = frame.iloc[:, k]
        changes = np.flatnonzero((values != values.shift()).to_numpy()[1:])
        if len(back) and np.array_equal(changes, back) and values.nunique() == len(back) + 1:
            found.append(str(name))
    return found

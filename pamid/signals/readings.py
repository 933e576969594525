"""Impossible or unlikely readings of a sensor: found in every log that is read, and reported.

All commands share this check: it runs while a log is read, on signals in SI.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
import pandas as pd

from pamid.constants import ATMOSPHERIC_PRESSURE
from pamid.errors import ReadingError

from ._rows import blocks
from .reading_notes import MISSING, USED, Readings
from .units import base_name, dimension_of, is_gauge_name

Rows: TypeAlias = np.ndarray | slice
"""Rows of a run: a slice where they follow one another, since what it takes is no copy."""

BEYOND = 1e30
"""No quantity of a log is as large in SI; markers of missing values and overflows are."""

_SENSORS = frozenset(("P", "p", "p_gauge", "P_supply", "F", "mdot", "q", "eps", "L", "length", "x", "stroke", "T", "u"))
_QUICK = ("mdot", "u")  # signals that may jump from rest as a run begins: a valve opens at once
_FULL_COMMAND = 1.5  # within it a command may well jump there and back
_COMMANDS = ("_ref", "_cmd", "_set")
_FEW = 50  # rows below which neither a glitch nor a dead channel can be detected
_WIDTHS = (1, 2)  # samples of a glitch
_OF_JUMPS, _OF_STEPS = 20.0, 10.0
_RARE = 6  # steps and jumps that a glitch or two make: they do not count as usual in a short log
_BACK = 0.75  # of the way there
_ENDS = ((0, 1), (-1, -2))  # the first and the last reading of a run, and the one beside it
_MOST_GLITCHES = 0.002  # of the rows: what comes more often may belong to the signal


def impossible(signal: str, values: np.ndarray, ambient_pressure: float = ATMOSPHERIC_PRESSURE) -> np.ndarray:
    """Return which readings the quantity of a signal cannot take, such as pressures below 0."""
    bad = np.abs(values) > BEYOND
    dimension = dimension_of(signal)
    if dimension in ("pressure", "temperature"):
        bad |= values <= (-ambient_pressure if is_gauge_name(signal) else 0.0)
    elif base_name(signal) == "eps":
        bad |= values >= 1.0
    return bad & np.isfinite(values) if bad.any() else bad


def screen(
    frame: pd.DataFrame,
    origin: pd.DataFrame,
    *,
    nan: str,
    skip: set[str],
    ambient_pressure: float,
    where: str,
    notes: Readings,
) -> pd.DataFrame:
    """Check the readings of a tidy frame; impossible ones and glitches become missing."""
    runs = list(blocks(frame["trajectory"].to_numpy(dtype=object)))
    rows_of_runs = [rows for _, rows in runs]
    changed: dict[str, np.ndarray] = {}
    for signal in (str(c) for c in frame.columns if c not in ("trajectory", "time")):
        values = frame[signal].to_numpy(dtype=float)
        bad = impossible("" if signal in skip else signal, values, ambient_pressure)  # a user's T may be a torque
        if bad.any():
            notes.note(signal, "impossible", frame, bad, MISSING, origin)
            if nan == "raise":
                raise ReadingError(
                    f"{where}: {notes.words(signal, 'impossible')}.",
                    "readings that the quantity can have",
                    "Read with nan='keep' to take them as missing, or nan='drop' to leave these rows out.",
                )
        if base_name(signal) in _SENSORS and not signal.endswith(_COMMANDS) and signal not in skip:
            readings = _without(values, bad)
            jumps = glitches(readings, rows_of_runs)
            if base_name(signal) == "u":
                jumps &= np.abs(values) > _FULL_COMMAND
            if jumps.any():
                rare = nan != "raise" and jumps.sum() <= max(3.0, _MOST_GLITCHES * len(values))
                notes.note(signal, "glitch", frame, jumps, MISSING if rare else USED, origin)
                bad |= jumps & rare
                readings = _without(values, bad)
            ends = _far_ends(readings, rows_of_runs, outward=base_name(signal) in _QUICK)
            if base_name(signal) == "mdot" and ends.any():
                ends &= ~_of_command(frame, signal, rows_of_runs)
            if ends.any():
                notes.note(signal, "end", frame, ends, USED, origin)
        if bad.any():
            changed[signal] = _without(values, bad)
    frame = frame.assign(**changed) if changed else frame
    sensors = _sensors(frame)
    _note_still(sensors, runs, skip, notes)
    for name, mark in _marks(sensors, runs).items():
        if mark in notes.seen:
            notes.repeated.append((name, notes.seen[mark]))
        notes.seen.setdefault(mark, name)
    return frame


def _without(values: np.ndarray, bad: np.ndarray) -> np.ndarray:
    return np.where(bad, np.nan, values) if bad.any() else values


def run_marks(frame: pd.DataFrame) -> dict[str, str]:
    """Return a fingerprint of each run, which two runs share only if all samples are equal."""
    runs = [(str(k), np.asarray(v)) for k, v in frame.groupby("trajectory", sort=False).indices.items()]
    return _marks(_sensors(frame), runs)


def _sensors(frame: pd.DataFrame) -> dict[str, np.ndarray]:
    """Return the columns that a sensor reads."""
    names = [str(c) for c in frame.columns if base_name(str(c)) in _SENSORS and not str(c).endswith(_COMMANDS)]
    return {name: frame[name].to_numpy(dtype=float) for name in names}


def _marks(sensors: Mapping[str, np.ndarray], runs: Iterable[tuple[str, Rows]]) -> dict[str, str]:
    found: dict[str, str] = {}
    for run, rows in runs:
        readings = [y[rows] for y in sensors.values()]
        if readings and len(readings[0]) >= _FEW and any(_moves(y) for y in readings):
            mark = hashlib.sha256()
            for y in readings:
                mark.update(np.ascontiguousarray(y).data)
            found[run] = mark.hexdigest()
    return found


def _moves(y: np.ndarray) -> bool:
    return bool(np.any(y != y[0]))


def glitches(values: np.ndarray, runs: Sequence[Rows]) -> np.ndarray:
    """Return which readings jump away and back within two samples, against those of all but 1 % of the readings."""
    found = np.zeros(len(values), dtype=bool)
    kept = _kept(values, runs)
    series = [values[rows] for rows in kept]
    if sum(map(len, series)) < _FEW:
        return found
    steps = [np.abs(np.diff(y)) for y in series]
    largest = max(s.max(initial=0.0) for s in steps)
    if largest <= _OF_STEPS * _least_level(steps, largest) or largest <= (usual := _OF_STEPS * _level(steps)):
        return found  # no jump is larger than the steps that it is made of
    for width in _WIDTHS:
        back = [_there_and_back(y, width) for y in series]
        limit = max(usual, _OF_JUMPS * _level(back))
        for rows, jumps in zip(kept, back, strict=True):
            for k in np.flatnonzero(jumps > limit):
                found[np.arange(len(values))[rows][k + 1 : k + 1 + width]] = True
    return found


def _kept(values: np.ndarray, runs: Sequence[Rows]) -> Sequence[Rows]:
    """Return the rows of each run that have a reading."""
    good = np.isfinite(values)
    if good.all():
        return runs
    return [np.arange(len(values))[rows][good[rows]] for rows in runs]


def _level(arrays: list[np.ndarray]) -> float:
    """Return the level below which all but 1 % of the values, and at least a few, lie."""
    together = np.concatenate(arrays)
    return float(np.quantile(together, _share(len(together)), method="lower")) if len(together) else 0.0


def _share(n: int) -> float:
    return max(1.0 - max(0.01, _RARE / max(n, 1)), 0.0)


def _least_level(arrays: list[np.ndarray], largest: float) -> float:
    """Bound `_level` of the positive values from below by their mean, so that no value has to be sorted."""
    n = sum(int(np.count_nonzero(a)) for a in arrays)
    below = int(_share(n) * (n - 1))  # one fewer than it are, so that rounding does not matter
    if below < 1:
        return 0.0
    return max((sum(float(a.sum()) for a in arrays) - (n - below) * largest) / below, 0.0)


def _there_and_back(y: np.ndarray, width: int) -> np.ndarray:
    """Return how far each stretch of samples within a run is from its neighbours, 0 unless these agree."""
    if len(y) < width + 2:
        return np.zeros(0)
    up = np.diff(y)[: len(y) - 1 - width]
    down = -np.diff(y)[width:]
    least, most = np.minimum(np.abs(up), np.abs(down)), np.maximum(np.abs(up), np.abs(down))
    return np.where((up * down > 0) & (least > _BACK * most), least, 0.0)


def _far_ends(values: np.ndarray, runs: Sequence[Rows], *, outward: bool) -> np.ndarray:
    """Return which first and last readings of runs are off: far from all others, or a leap from the next one."""
    found = np.zeros(len(values), dtype=bool)
    kept = [(rows, values[rows]) for rows in _kept(values, runs)]
    kept = [(rows, y) for rows, y in kept if len(y) > 2]
    if sum(len(y) - 2 for _, y in kept) < _FEW:
        return found
    low, high = min(float(y[1:-1].min()) for _, y in kept), max(float(y[1:-1].max()) for _, y in kept)
    if high == low:
        return found
    steps = [np.abs(np.diff(y[1:-1])) for _, y in kept]
    leap = _OF_STEPS * _least_level(steps, max(s.max(initial=0.0) for s in steps))
    if any(abs(y[a] - y[b]) > leap for _, y in kept for a, b in _ENDS):
        leap = _OF_STEPS * _level([s[s > 0] for s in steps])
    for rows, y in kept:
        for end, beside in _ENDS:
            outside = max(y[end] - high, low - y[end]) > high - low
            leaps = abs(y[end] - y[beside]) > leap
            if outside or (leaps and not (outward and abs(y[end]) < abs(y[beside]))):
                found[np.arange(len(values))[rows][end]] = True
    return found


def _of_command(frame: pd.DataFrame, flow: str, runs: Sequence[Rows]) -> np.ndarray:
    """Return the ends of runs at which a flow jumps because its valve's command does."""
    command = "u" + flow.removeprefix("mdot")
    if command not in frame:
        return np.zeros(len(frame), dtype=bool)
    return _far_ends(frame[command].to_numpy(dtype=float), runs, outward=True)


def _note_still(
    sensors: Mapping[str, np.ndarray], runs: Sequence[tuple[str, Rows]], skip: set[str], notes: Readings
) -> None:
    """Note which channels are constant during a run in which others are not."""
    for run, rows in runs:
        readings = {name: y[rows] for name, y in sensors.items()}
        count = len(next(iter(readings.values()), ()))
        if count < _FEW:
            continue
        notes.runs += 1
        notes.rows += count
        moves = {name: _moves(y) for name, y in readings.items()}
        for name in (n for n, moving in moves.items() if not moving and n not in skip and any(moves.values())):
            notes.still.setdefault(name, {})[run] = float(readings[name][0])

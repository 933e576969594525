"""Commands and readings in separate files, each with its own time stamps, joined by time to one run."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..errors import LogError, MissingColumnError, TimeOrderError
from .formats import TRAJECTORY, RawTable, format_of
from .mapping import LogMapping
from .robots import own_clock
from .unit_names import find_unit
from .vocabulary import kinds_of

_TABLES = ("text (CSV)", "parquet")
_COMMANDS = frozenset(("action", "control", "controls", "ctrl"))
_PERIODS = 2.0
_FARTHEST, _LAGS = 0.5, 64
"""Longest delay searched, s, and the number of steps within it."""
_FOLLOWS = 0.1
"""Share of a command's variance by which a reading of another name may differ from it and still follow it."""
_NUMBER = re.compile(r"\d+")
Source = tuple[Path, list[RawTable], "pd.DataFrame | None"]


class Joined(NamedTuple):
    """How the files of a run were joined."""

    run: str
    """Folder of the files."""
    readings: str
    commands: str
    """File whose stamps the rows keep, and one that was brought to them."""
    held: bool
    """Whether its values hold until the next, as commands do; else they are interpolated."""
    age: float
    """Median age of the value held at a reading, s."""
    delay: float | None
    """By how much later than the stamps of commands the readings that are called alike, or else follow them, are most
    like them, s; None where there are none or none moves."""
    rows: int
    """Rows joined."""


def sources(files: Sequence[Path], mapping: LogMapping, max_bytes: int, told: list[Joined]) -> Iterator[Source]:
    """Yield the tables of files, those of one run in several files joined by time."""
    for folder, together in groupby(files, key=lambda f: f.parent):
        group = list(together)
        if parts := _parts(group, mapping, max_bytes):
            yield folder, [_joined(folder, parts, mapping, told)], None
            continue
        for path in group:
            yield path, *format_of(path, mapping.encoding).read(path, mapping, max_bytes)


def is_joined(files: Sequence[Path], mapping: LogMapping, max_bytes: int) -> bool:
    """Return whether some files are parts of one run."""
    return any(_parts(list(g), mapping, max_bytes) for _, g in groupby(files, key=lambda f: f.parent))


def sentence(told: Sequence[Joined]) -> str:
    """Return how files were joined and the delay between them; empty if none were."""
    if not told:
        return ""
    first = told[0]
    runs = f" in {len({t.run for t in told})} runs" if len({t.run for t in told}) > 1 else ""
    alike = [t for t in told if (t.readings, t.commands) == (first.readings, first.commands)]
    how = "held until the next" if first.held else "interpolated"
    ages = 1e3 * np.array([t.age for t in alike])
    said = f"{first.commands} is joined with {first.readings} by time{runs}: each of its values is {how}"
    said += f", {np.median(ages):.2g} ms old at a reading" if first.held else ""
    delays = 1e3 * np.array([t.delay for t in alike if t.delay is not None])
    if len(delays):
        spread = f" ({delays.min():.0f} to {delays.max():.0f} ms)" if len(delays) > 1 else ""
        said += f"; readings lag commands by {np.median(delays):.0f} ms{spread}"
    return said


# --- which files belong together -----------------------------------------------------------------------------
def _parts(files: list[Path], mapping: LogMapping, max_bytes: int) -> dict[str, pd.DataFrame] | None:
    """Return the tables of one run by file; None if each file is a run."""
    if len(files) < 2 or any(format_of(f, mapping.encoding).name not in _TABLES for f in files) or _same_header(files):
        return None
    tables: dict[str, pd.DataFrame] = {}
    for path in files:
        try:
            frame = format_of(path, mapping.encoding).read(path, mapping, max_bytes)[0][0].frame
        except LogError:
            return None
        if TRAJECTORY in frame or mapping.trajectory is not None:
            return None
        if _clock(frame, mapping) is not None and len(_numbers(frame, mapping)) and len(frame) > 1:
            tables[path.stem] = frame
    if len(tables) < 2 or len(tables) > 8:
        return None
    return tables if _of_one_run(tables, mapping) and _overlap(tables, mapping) else None


def _same_header(files: list[Path]) -> bool:
    """Return whether files begin with the same line, like runs of one recorder."""
    first = set()
    for path in files:
        with path.open("rb") as stream:
            first.add(stream.readline(4096))
    return len(first) == 1


def _of_one_run(tables: dict[str, pd.DataFrame], mapping: LogMapping) -> bool:
    columns = {stem: set(_numbers(frame, mapping)) for stem, frame in tables.items()}
    wanted = _wanted(mapping)
    if wanted:
        prefixed = any(w.startswith(f"{stem}.") for w in wanted for stem in tables)
        whole = any(wanted <= {*own, *map(str, tables[stem].columns)} for stem, own in columns.items())
        return prefixed or not whole
    sets = list(columns.values())
    if all(s == sets[0] for s in sets):
        return False
    nested = any(a <= b for k, a in enumerate(sets) for j, b in enumerate(sets) if j != k)
    kinds = {_NUMBER.sub("", stem) for stem in tables}
    return len(kinds) == len(tables) and (not nested or any(_commands(stem) for stem in tables))


def _overlap(tables: dict[str, pd.DataFrame], mapping: LogMapping) -> bool:
    """Return whether clocks share most of their time."""
    ends = []
    for frame in tables.values():
        t = frame[_clock(frame, mapping)].to_numpy(dtype=float)
        ends.append((np.nanmin(t), np.nanmax(t)))
    common = min(b for _, b in ends) - max(a for a, _ in ends)
    return bool(common > 0.5 * max(b - a for a, b in ends))


def _wanted(mapping: LogMapping) -> set[str]:
    return {str(m.column if m.column is not None else n) for n, m in mapping.signals.items() if n != "time"}


def _clock(frame: pd.DataFrame, mapping: LogMapping) -> str | None:
    """Return the column that is a table's clock."""
    own = own_clock(frame.columns, mapping)
    numeric = [c for c in frame.columns if isinstance(c, str) and pd.api.types.is_numeric_dtype(frame[c].dtype)]
    given = mapping.signals["time"].column if "time" in mapping.signals else "time"
    if given in numeric:
        return str(given)
    found = [c for c in numeric if own.get(c) == "time" or "time" in kinds_of(re.findall(r"[^\W_]+", c.lower()))]
    return found[0] if len(found) == 1 else None


def _numbers(frame: pd.DataFrame, mapping: LogMapping) -> list[str]:
    clock = _clock(frame, mapping)
    return [str(c) for c in frame.columns if pd.api.types.is_numeric_dtype(frame[c].dtype) and c != clock]


def _commands(stem: str) -> bool:
    """Return whether a file's name says that it holds commands."""
    words = re.findall(r"[^\W\d_]+", stem.lower())
    return bool(_COMMANDS & set(words) or {"u", "wanted"} & kinds_of(words))


# --- joining -------------------------------------------------------------------------------------------------
def _joined(folder: Path, tables: dict[str, pd.DataFrame], mapping: LogMapping, told: list[Joined]) -> RawTable:
    """Return one table at the times of the readings: commands are held, other signals interpolated."""
    clocks = {stem: str(_clock(frame, mapping)) for stem, frame in tables.items()}
    base = max(tables, key=lambda s: (not _commands(s), len(_numbers(tables[s], mapping)), len(tables[s])))
    uses = Counter(c for frame in tables.values() for c in _numbers(frame, mapping))
    wanted = _wanted(mapping)
    t = tables[base][clocks[base]].to_numpy(dtype=float)
    keep, brought = np.isfinite(t), {}
    for stem, frame in tables.items():
        if stem == base:
            continue
        when = frame[clocks[stem]].to_numpy(dtype=float)
        if np.any(np.diff(when) < 0.0):
            raise TimeOrderError(
                f"The time of {stem} in {folder.name} goes back.", "time stamps in order", "Sort the file by time."
            )
        last = when[-1] + _PERIODS * float(np.median(np.diff(when)))
        keep &= (t >= when[0]) & (t <= (last if _commands(stem) else when[-1]))
        brought[stem] = when
    if not keep.any():
        raise MissingColumnError(
            f"The files of {folder.name} have no time in common.",
            "time stamps of one clock",
            "Correct the clock of one.",
        )
    t = t[keep]
    read: dict[str, dict[str, np.ndarray]] = {}
    for stem, frame in tables.items():
        own = {name: frame[name].to_numpy(dtype=float) for name in _numbers(frame, mapping)}
        if stem == base:
            read[stem] = {name: x[keep] for name, x in own.items()}
        elif _commands(stem):
            before = np.searchsorted(brought[stem], t, side="right") - 1
            read[stem] = {name: x[before] for name, x in own.items()}
        else:
            read[stem] = {name: np.interp(t, brought[stem], x) for name, x in own.items()}
    columns: dict[str, Any] = {clocks[base]: t}
    for stem, own in read.items():
        full = {name: f"{stem}.{name}" for name in own}
        columns |= {full[n] if uses[n] > 1 or full[n] in wanted else n: x for n, x in own.items()}
    unit = _seconds(t, clocks[base], mapping)
    for stem, when in brought.items():
        held = _commands(stem)
        age = float(np.median(t - when[np.searchsorted(when, t, side="right") - 1])) * unit if held else 0.0
        alike = [(read[base][name], x) for name, x in read[stem].items() if name in read[base]]
        if held and not alike:
            alike = _following(unit * t, list(read[base].values()), list(read[stem].values()))
        later = delay_of(unit * t, alike) if held else None
        told.append(Joined(folder.name, base, stem, held, age, None if later is None else later + age, len(t)))
    return RawTable(pd.DataFrame(columns))


def _seconds(t: np.ndarray, clock: str, mapping: LogMapping) -> float:
    """Return a clock's unit in seconds: from the mapping, else the one that gives a rate of 1 to 10,000 Hz."""
    given = mapping.signals.get("time")
    if given is not None and given.unit:
        return float(find_unit(given.unit).factor)
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    return next((unit for unit in (1.0, 1e-3, 1e-6, 1e-9) if step * unit <= 1.0), 1.0)


def _following(
    t: np.ndarray, readings: Sequence[np.ndarray], commands: Sequence[np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return with each command that moves the reading that is most like it, if one follows it."""
    found = []
    for command in commands:
        left, k = min(((_left(t, r, command).min(), k) for k, r in enumerate(readings)), default=(np.inf, 0))
        if left < _FOLLOWS * np.var(command):
            found.append((readings[k], command))
    return found


def _lags(t: np.ndarray) -> np.ndarray:
    return np.linspace(0.0, min(_FARTHEST, 0.2 * float(np.ptp(t))), _LAGS + 1)


def _left(t: np.ndarray, reading: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Return the variance of a reading's difference from a command at each lag."""
    lags = _lags(t)
    inside = t >= t[0] + lags[-1]
    return np.array([np.var(reading[inside] - np.interp(t[inside] - lag, t, command)) for lag in lags])


def delay_of(t: np.ndarray, pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float | None:
    """Return the delay at which readings are most similar to commands."""
    found, lags = [], _lags(t)
    for reading, command in pairs:
        if not np.std(command) > 1e-9 * (1.0 + np.abs(command).max()) or not np.ptp(reading) > 0.0:
            continue
        left = _left(t, reading, command)
        k = int(np.argmin(left))
        if 0 < k < _LAGS:  # the vertex of the parabola through three points
            below, here, above = left[k - 1 : k + 2]
            found.append(lags[k] + 0.5 * (lags[1]) * (below - above) / max(below - 2 * here + above, 1e-300))
        elif k == 0:
            found.append(0.0)
    return float(np.median(found)) if found else None


__all__ = ["Joined", "delay_of", "is_joined", "sentence", "sources"]

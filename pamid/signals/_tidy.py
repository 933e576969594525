"""From a table as it is in a file to a tidy frame: the mapping is applied here."""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pamid.errors import ColumnTypeError, DuplicateColumnError, EmptyLogError, MappingError, MissingColumnError

from .formats import TRAJECTORY, RawTable, is_measured, names_column
from .formats._lists import list_elements
from .mapping import LogMapping, SignalMapping
from .robots import with_own_clock
from .stamps import seconds_of_stamps
from .unit_names import unit_name
from .units import UNITS, base_name, dimension_of, is_gauge_name
from .vocabulary import WORDS

_CLOCK = 1e8
_NAME_WITH_UNIT = re.compile(r"^\s*(.+?)\s*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")


_RATES = ("fs", "fsample", "samplingrate", "samplerate", "samplingfrequency", "samplefrequency")
"""Names for the sampling rate and the sampling period stored beside a table."""
_PERIODS = ("ts", "dt", "tsample", "samplingperiod", "sampleperiod", "samplingtime", "sampletime", "samplinginterval")


@dataclass
class Part:
    """One table after mapping."""

    frame: pd.DataFrame
    unchecked: set[str]
    variable: str | None
    fixed: set[str]
    unread: dict[str, str]
    left_out: tuple[str, ...] = ()


def tidy(
    table: RawTable, zero_run: pd.DataFrame | None, mapping: LogMapping, path: Path, *, several: bool = False
) -> Part:
    """Apply a mapping to one table."""
    raw = with_own_clock(_with_head(table, mapping), mapping)
    if len(raw) == 0:
        raise EmptyLogError(f"{path.name} holds no rows.", "a table of samples", "Record the log again.")
    double = raw.columns[raw.columns.duplicated()]
    if len(double):
        raise DuplicateColumnError(
            f"{path.name} has several columns named '{double[0]}'.", "each name once", "Rename one of them."
        )
    own = {str(c): i for i, c in enumerate(raw.columns)}
    words = () if mapping.signals else _words(raw, mapping)
    used_trajectory = _trajectory_column(raw, mapping, path)
    if used_trajectory is None and mapping.trajectory is not None:
        words += (f"no column {mapping.trajectory!r} names the runs, so this file is read as one run",)
    signals = dict(mapping.signals) or _by_own_names(table, raw, used_trajectory, mapping, path)
    if mapping.signals and "time" not in signals and mapping.sampling_period is None and table.named:
        signals |= _clock(raw)  # a mapping that leaves it out takes it as it is
    places = {s: _position(raw, m.column if m.column is not None else s, s, path, own) for s, m in signals.items()}
    if mapping.keep_others and mapping.signals:
        taken = {*places.values(), used_trajectory}
        for name, position in own.items():
            numeric = pd.api.types.is_numeric_dtype(raw.iloc[:, position])
            if position not in taken and numeric and name not in signals:
                signals[name], places[name] = SignalMapping(column=position), position
    constants = mapping.constants_of(path)
    keep = np.ones(len(raw), dtype=bool)
    columns: dict[str, np.ndarray] = {}
    unchecked: set[str] = set()
    for signal, how in signals.items():
        how = _as_meant(signal, how, mapping)
        values = numbers_of(raw.iloc[:, places[signal]], signal, path)
        if how.allowed is not None:
            keep &= np.isin(values, how.allowed)
        if how.range is not None:
            keep &= (values >= how.range[0]) & (values <= how.range[1])
        if how.own or not how.check or (signal == "time" and how.unit):
            unchecked.add(signal)
        zero = _zero(zero_run, places[signal], signal, path, mapping) if how.subtract_zero_run else 0.0
        columns[signal] = as_wanted(values - zero, signal, how, constants, mapping, path)
    read = set(columns)
    _add_constants(columns, constants, len(raw))
    if "time" not in columns:
        period, said = sampling_period(table, mapping.sampling_period)
        words += said
        columns["time"] = _time_from_rows(len(raw), period, path, own)
    frame = pd.DataFrame(columns)
    names = _names(table, raw, used_trajectory, mapping, path, several)
    frame.insert(0, TRAJECTORY, names)
    frame = frame[[TRAJECTORY, "time", *[c for c in frame.columns if c not in (TRAJECTORY, "time")]]]
    if mapping.skip_rows:
        keep &= frame.groupby(TRAJECTORY, sort=False).cumcount().to_numpy() >= mapping.skip_rows
    if not keep.all():
        frame = frame.loc[keep].reset_index(drop=True)
    return Part(
        _clock_to_run_time(frame), unchecked, table.variable, set(columns) - read, _unread(mapping, signals), words
    )


def _with_head(table: RawTable, mapping: LogMapping) -> pd.DataFrame:
    """Return the table with the scalars that the mapping names as constant columns."""
    wanted = [m.column for m in mapping.signals.values() if isinstance(m.column, str)]
    found = {
        name: float(table.head[name])
        for name in dict.fromkeys(wanted)
        if name not in table.frame.columns and isinstance(table.head.get(name), int | float)
    }
    return table.frame.assign(**found) if found else table.frame


def _trajectory_column(raw: pd.DataFrame, mapping: LogMapping, path: Path) -> int | None:
    """Return the column that names the runs; a single run, recorded later, often comes without it."""
    if isinstance(mapping.trajectory, int):
        return _position(raw, mapping.trajectory, TRAJECTORY, path, {})
    position = names_column(raw.columns, mapping)
    if position is not None and is_measured(raw.iloc[:, position], mapping):
        raise ColumnTypeError(
            f"{path.name} has {raw.iloc[:, position].nunique()} different numbers in {len(raw)} rows of the column "
            f"{raw.columns[position]!r}: a signal.",
            "the name of the run there, the same in all rows of a run",
            f"Rename the column, or map the signal: NAME = {{ column = {TRAJECTORY!r} }}; "
            f"'pamid init LOG --signal NAME={TRAJECTORY}' writes that.",
        )
    return position


def _words(raw: pd.DataFrame, mapping: LogMapping) -> tuple[str, ...]:
    """Note which columns hold text, such as remarks: they are left out."""
    at = names_column(raw.columns, mapping)
    found = [
        str(c) for k, c in enumerate(raw.columns)
        if k != at and pd.api.types.is_string_dtype(raw.iloc[:, k].dropna()) and dimension_of(str(c)) is None
    ]  # fmt: skip
    return (f"{', '.join(repr(c) for c in found[:4])} left out (text, not numbers)",) if found else ()


def _by_own_names(
    table: RawTable, raw: pd.DataFrame, skip: int | None, mapping: LogMapping, path: Path
) -> dict[str, SignalMapping]:
    """Without a mapping: return every column under its own name, converted from the unit in brackets, if any."""
    if not table.named:
        raise MissingColumnError(
            f"{path.name} has {raw.shape[1]} columns without names.",
            "names such as time, P, F, q",
            "Pass a mapping that says which column is which, by position: {'time': 0, 'P': {'column': 1, ...}}; "
            "'pamid init' writes one.",
        )
    signals: dict[str, SignalMapping] = {}
    clock = _clock_at(raw)
    elements = list_elements(map(str, raw.columns))
    for position, column in enumerate(raw.columns):
        if position == skip:
            continue
        name, unit = (str(column).strip(), None) if column in elements else for_port(str(column), mapping.own)
        if position == clock and name not in mapping.own:
            name = "time"
        text = not pd.api.types.is_numeric_dtype(raw.iloc[:, position])
        if text and dimension_of(name) is None and not pd.api.types.is_datetime64_any_dtype(raw.iloc[:, position]):
            continue
        if not name or name in signals:
            raise DuplicateColumnError(
                f"{path.name} has several columns named '{name}'.", "each name once", "Rename one of them."
            )
        signals[name] = SignalMapping.from_value(name, {"column": position, "unit": unit}, name in mapping.own)
    if not signals:
        raise MissingColumnError(f"{path.name} has no numeric column.", "signals", "Check the export.")
    return signals


def for_port(column: str, own: Mapping[str, str]) -> tuple[str, str | None]:
    """Return a column's name and unit as a simulator file writes them: the name with its unit or without."""
    header, match = column.strip(), _NAME_WITH_UNIT.match(column)
    known = unit_name(match[2]) if match else None
    if match is None or known is None or not {header, match[1]} & own.keys():
        return _name_and_unit(column)
    name = header if header in own else match[1]
    return name, None if own[name] == "-" else known  # what has no unit is as the log has it


def _name_and_unit(column: object) -> tuple[str, str | None]:
    """Return a column's name and the unit in brackets behind it; None where there is none that is known."""
    match = _NAME_WITH_UNIT.match(str(column))
    return (match[1], match[2]) if match and match[2] in UNITS else (str(column).strip(), None)


def _clock(raw: pd.DataFrame) -> dict[str, SignalMapping]:
    """Return the signal of the column that is the clock, if there is one."""
    position = _clock_at(raw)
    if position is None:
        return {}
    unit = _name_and_unit(raw.columns[position])[1]
    return {"time": SignalMapping.from_value("time", {"column": position, "unit": unit}, False)}


def _clock_at(raw: pd.DataFrame) -> int | None:
    """Return the column that is called time, or the only one with another word for it and a unit of time."""
    names = [_name_and_unit(column) for column in raw.columns]
    called = [k for k, (name, _) in enumerate(names) if name.lower() == "time"]
    meant = [k for k, (name, unit) in enumerate(names)
             if unit is not None and UNITS[unit].dimension == "time" and name.lower() in WORDS["time"]]  # fmt: skip
    return called[0] if called else meant[0] if len(meant) == 1 else None


def _unread(mapping: LogMapping, signals: dict[str, SignalMapping]) -> dict[str, str]:
    """Return the columns with the name of a signal and an unknown unit in brackets."""
    if mapping.signals:
        return {}
    elements = list_elements(signals)
    found = {n: match for n in signals if n not in elements and (match := _NAME_WITH_UNIT.match(n))}
    return {
        name: f"not read as {match[1]}, since '{match[2][:20]}' is not a known unit"
        for name, match in found.items()
        if dimension_of(match[1]) is not None and match[1] not in signals
    }


def _position(raw: pd.DataFrame, column: str | int, signal: str, path: Path, own: dict[str, int]) -> int:
    if isinstance(column, str):
        if column in own:
            return own[column]
        near = difflib.get_close_matches(column, own, n=1, cutoff=0.5)
        raise MissingColumnError(
            f"{path.name} has no column '{column}' for {signal}; it has {', '.join(list(own)[:20])}.",
            "the columns that the mapping names",
            f"Correct the mapping{f'; did you mean {near[0]!r}?' if near else '.'}",
        )
    if not 0 <= column < raw.shape[1]:
        raise MissingColumnError(
            f"{path.name} has {raw.shape[1]} columns, and the mapping takes {signal} from position {column}.",
            f"a position from 0 to {raw.shape[1] - 1}",
            "Correct the mapping.",
        )
    return int(column)


def numbers_of(column: pd.Series, signal: str, path: Path) -> np.ndarray:
    """Return the values of a signal's column; of a clock also stamps of date and time, as seconds."""
    if signal == "time" and pd.api.types.is_timedelta64_dtype(column):
        return column.dt.total_seconds().to_numpy()
    if signal == "time" and not pd.api.types.is_numeric_dtype(column):
        seconds = seconds_of_stamps(column)
        if seconds is not None:
            return seconds
    if pd.api.types.is_complex_dtype(column):
        raise ColumnTypeError(f"{signal} of {path.name} holds complex numbers.", "real numbers", "Export real parts.")
    if not pd.api.types.is_numeric_dtype(column):
        numbers = pd.to_numeric(column, errors="coerce")
        bad = numbers.isna() & column.notna()
        if bad.any():
            row = int(bad.to_numpy().argmax())
            raise ColumnTypeError(
                f"Column '{column.name}' of {path.name}, mapped to {signal}, holds {str(column.iloc[row])[:40]!r} in "
                f"row {row + 1} and text in {int(bad.sum())} of {len(column)} rows.",
                "numbers",
                "Correct the rows, or map another column.",
            )
        column = numbers
    return column.to_numpy(dtype=float, na_value=np.nan)


def _zero(zero_run: pd.DataFrame | None, position: int, signal: str, path: Path, mapping: LogMapping) -> float:
    if zero_run is None:
        raise MappingError(
            f"The zero run is to be subtracted from {signal}, but {path.name} has none.",
            "zero_run to name the variable of the zero run",
            "Set zero_run in the mapping, or remove subtract_zero_run.",
        )
    if position >= zero_run.shape[1]:
        raise MissingColumnError(
            f"The zero run '{mapping.zero_run}' of {path.name} has {zero_run.shape[1]} columns; {signal} is column "
            f"{position}.",
            "the zero run to have the same columns",
            "Correct the mapping.",
        )
    return float(np.nanmean(zero_run.iloc[:, position].to_numpy(dtype=float)))


def _as_meant(signal: str, how: SignalMapping, mapping: LogMapping) -> SignalMapping:
    """Return how to read a signal; a simulator's port may have the name of another quantity, such as a torque T."""
    unit, known = UNITS.get(unit_name(mapping.own.get(signal, "")) or ""), dimension_of(signal)
    other = unit is not None and known is not None and unit.dimension != known
    return replace(how, own=True) if other else how


def to_si(
    values: np.ndarray, signal: str, how: SignalMapping, constants: dict[str, float], ambient: float, path: Path,
    own: bool = False,
) -> np.ndarray:  # fmt: skip
    """Return a column's values in SI, as its mapping says; an absolute pressure of one's `own` simulator stays so."""
    unit = how.si_unit(signal)
    if how.offset:
        values = values + how.offset
    if (factor := how.sign * how.scale) != 1.0:
        values = values * factor
    if how.offset_after:
        values = values + how.offset_after
    if unit is not None:
        # Dividing where the inverse is the rounder number keeps 251 ms at 0.251 s to the last bit.
        inverse = round(1 / unit.factor) if 0 < unit.factor < 1 else 0
        values = values / inverse if inverse and 1 / inverse == unit.factor else values * unit.factor
        values = values + unit.offset if unit.offset else values
    if how.source != "value":
        rest = constants.get("rest_length")
        if rest is None or rest <= 0:
            raise MappingError(
                f"{signal} is to be computed from a {how.source}, but {path.name} has no rest_length.",
                "the constant rest_length",
                "Add rest_length to constants, for instance rest_length = '200 mm'.",
            )
        return (rest - values) / rest if how.source == "length" else values / rest
    pressure = (unit.dimension if unit else how.dimension(signal)) == "pressure"
    if pressure:
        source_gauge, wants_gauge = how.is_gauge(signal), is_gauge_name(signal)
        if source_gauge and not wants_gauge:
            return values + ambient
        if wants_gauge and not source_gauge and not own:
            return values - ambient
    return values


def as_wanted(
    values: np.ndarray, signal: str, how: SignalMapping, constants: dict[str, float], mapping: LogMapping, path: Path
) -> np.ndarray:
    """Return a column's values in SI, or in the unit in which a simulator wants them; without a unit as they are."""
    unit, stated = UNITS.get(unit_name(mapping.own.get(signal, "")) or ""), how.si_unit(signal)
    offset, factor = 0.0, 1.0
    if unit is not None and stated is not None and unit.dimension == stated.dimension:
        if unit[1:3] == stated[1:3] and how.source == "value":  # unchanged to the last bit
            how = replace(how, unit=None)
        else:
            offset, factor = unit.offset, unit.factor
    found = to_si(values, signal, how, constants, mapping.ambient_pressure, path, signal in mapping.own)
    return (found - offset) / factor if (offset, factor) != (0.0, 1.0) else found


def _add_constants(columns: dict[str, np.ndarray], constants: dict[str, float], n: int) -> None:
    """Add constants as columns; ``length`` and ``rest_length`` give ``eps``."""
    constants = dict(constants)
    rest, length = constants.pop("rest_length", None), constants.pop("length", None)
    if rest is not None and length is not None:
        constants.setdefault("eps", (rest - length) / rest)
    for name, value in constants.items():
        if name in columns:
            raise DuplicateColumnError(
                f"{name} is both a mapped signal and a constant.", "one of the two", "Remove one from the mapping."
            )
        columns[name] = np.full(n, value)


def sampling_period(table: RawTable, given: float | None) -> tuple[float | None, tuple[str, ...]]:
    """Return the sampling period, as given or from a scalar of the file, and a note that this was used."""
    if given is not None:
        return given, ()
    for name, value in table.head.items():
        called = str(name).lower().replace("_", "")
        number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else 0.0
        if not (np.isfinite(number) and number > 0.0) or called not in (*_RATES, *_PERIODS):
            continue
        period = 1.0 / number if called in _RATES else number
        return period, (f"no time column, so time is counted from {name} = {number:g}, {period:g} s per row",)
    return None, ()


def _time_from_rows(n: int, period: float | None, path: Path, own: dict[str, int]) -> np.ndarray:
    if period is None:
        raise MissingColumnError(
            f"{path.name} has no time; it has {', '.join(list(own)[:20])}.",
            "a column named time, in s",
            "Map a column to time, as 'pamid init' does, or give sampling_period in the mapping.",
        )
    return np.arange(n) * period


def _names(
    table: RawTable, raw: pd.DataFrame, position: int | None, mapping: LogMapping, path: Path, several: bool
) -> Any:
    stem = path.stem
    column = None
    if position is not None:
        column = as_names(raw.iloc[:, position])
        if nameless := int((column == "").sum()):
            raise ColumnTypeError(
                f"{path.name} names no run in {nameless} of {len(column)} rows.",
                "a run in every row",
                "Fill in the names or remove the rows.",
            )
    if mapping.name is not None:
        known: dict[str, Any] = {**table.head, "stem": stem, "variable": table.variable or ""}
        try:
            if column is not None:
                unique = {v: mapping.name.format(**{**known, TRAJECTORY: v}) for v in column.unique()}
                return column.map(unique)
            return mapping.name.format(**known)
        except (KeyError, IndexError, ValueError, AttributeError) as error:
            raise MappingError(
                f"The name {mapping.name!r} asks for {error}, which {path.name} does not contain.",
                f"only {', '.join(sorted(known))}",
                "Correct name in the mapping.",
            ) from None
    if column is not None:
        return column
    return f"{stem}-{table.variable}" if table.variable and several else stem


def as_names(column: pd.Series) -> pd.Series:
    """Turn names of runs into text, exactly as written; numbers keep all digits."""
    if pd.api.types.is_string_dtype(column.dtype) and column.dtype != object:
        return column.fillna("")
    names = [_as_name(v) for v in column.to_numpy()]
    try:
        "".join(names).encode()  # pandas 2 keeps what cannot be written
        return pd.Series(names, index=column.index, dtype="str")
    except UnicodeEncodeError as error:
        raise ColumnTypeError(
            f"The name of a run contains an incomplete character: {error.object[:40]!r}.", "Unicode text", "Rename it."
        ) from None


def _as_name(value: Any) -> str:
    if isinstance(value, str):
        return value
    if pd.isna(value):
        return ""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    if isinstance(value, float | np.floating):
        return np.format_float_positional(value, trim="-")
    return str(value)


def _clock_to_run_time(frame: pd.DataFrame) -> pd.DataFrame:
    """Convert times of day or since 1970 to times from the start of each run."""
    time = frame["time"].to_numpy(dtype=float)
    if not len(time) or not np.nanmin(np.abs(time), initial=np.inf) > _CLOCK:
        return frame
    return frame.assign(time=frame["time"] - frame.groupby(TRAJECTORY, sort=False)["time"].transform("first"))


__all__ = ["TRAJECTORY", "Part", "as_names", "base_name", "tidy"]

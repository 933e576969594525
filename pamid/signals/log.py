"""Reading a log of any format into one tidy frame: run, time, signals in SI."""

import csv
import difflib
import io
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from pamid.errors import (
    ColumnTypeError,
    EmptyLogError,
    LogFormatError,
    LogNotFoundError,
    MissingColumnError,
    ParameterError,
    ReadingWarning,
    SamplingWarning,
)

from ..face import AnySimulator
from ..files import replacing
from ..names import require_one_of
from ._rows import Notes, free_name, handle_missing, handle_time, note_sampling, sampling_error, with_names
from ._tidy import Part, as_names, tidy
from .formats import RawTable, known_extensions
from .formats._variables import natural
from .frames import as_pandas
from .joining import sentence, sources
from .mapping import LogMapping
from .plausibility import require_plausible
from .readings import impossible, screen
from .robots import data_set_files

PathLike = str | Path
MAX_BYTES = 16 * 2**30
_NAN, _SAMPLING = ("raise", "drop", "keep"), ("warn", "raise", "ignore")
_MOST_FAULTS = 0.1  # share of impossible readings above which a wrong unit is likelier than a sensor fault


def read_log(
    paths: PathLike | Iterable[PathLike],
    mapping: LogMapping | Mapping[str, Any] | PathLike | None = None,
    *,
    nan: str = "raise",
    time_order: str | None = None,
    duplicates: str | None = None,
    sampling: str = "warn",
    check_units: bool = True,
    ambient_pressure: float | None = None,
    encoding: str | None = None,
    max_bytes: int = MAX_BYTES,
    simulator: AnySimulator | None = None,
) -> pd.DataFrame:
    """Read logs into one tidy frame with the columns ``trajectory``, ``time`` (s) and the signals in SI.

    Parameters
    ----------
    paths : str, Path or iterable of them
        A file, several, a folder (all logs in it, not below it; JSON only where there is nothing else) or a pattern
        such as ``"data/*.mat"``. Text (CSV), parquet, MATLAB 5 to 7.3, HDF5 and JSON are distinguished by content.
        Files of one folder with other columns and the same time, such as commands and readings, are one run, joined by
        time; the folder of a LeRobot data set is all its episodes.
    mapping : LogMapping, dict, path of a TOML file, optional
        Names, units, references and constants of the log, see `LogMapping`. Without it the columns must have their
        names of the frame (``time``, ``P1``, ``q``, ...) and SI units, or the unit in brackets: ``P1 [bar]``.
    nan : {"raise", "drop", "keep"}, default="raise"
        What to do with rows that hold NaN. Infinite values, and NaN in time, are never kept. Impossible readings, such
        as an absolute pressure of 0, are an error with "raise" and missing values otherwise.
    time_order : {"raise", "sort", "split"}, optional
        Overrides the mapping's `time_order` (default "raise").
    duplicates : {"drop", "mean", "raise", "keep"}, optional
        Overrides the mapping's `duplicates` (default "drop").
    sampling : {"warn", "raise", "ignore"}, default="warn"
        What to do about merged rows, gaps and mixed sampling periods.
    check_units : bool, default=True
        Whether values must look like their unit.
    ambient_pressure : float, optional
        Overrides the mapping's ambient pressure, Pa, absolute.
    encoding : str, optional
        Overrides the mapping's encoding of text files, such as "big5".
    max_bytes : int, default=16 GiB
        Largest size of a file once decompressed.
    simulator : simulator, optional
        Of `read_simulator` and the like: columns of its ports are converted to the ports' units instead of SI, and
        need not look like what their names mean here.

    Returns
    -------
    DataFrame
        Columns ``trajectory`` (text), ``time`` (s), then the signals. Runs are contiguous, their time
        increases, and their names are unique: where two files share a name, ``@file`` is added.

    Raises
    ------
    LogError
        One subclass for each thing that can be wrong (see `pamid.errors`): the file, its columns, its values, its time,
        its runs. The message says what was found, what was expected and what to do.

    Warns
    -----
    SamplingWarning
        Once, on merged rows, gaps or mixed sampling periods.
    ReadingWarning
        Once, on readings that are impossible, that jump there and back, or that do not move, and what is done about
        them; and on files that were joined by time, with the delay between them.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from pamid.signals import read_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "sine-1.csv"
    ...     _ = file.write_text(chr(10).join(["t;p;x", "0;3,0;12,0", "10;3,1;12,5", "20;3,3;13,0"]))
    ...     log = read_log(
    ...         file,
    ...         {
    ...             "time": {"column": "t", "unit": "ms"},
    ...             "P": {"column": "p", "unit": "bar", "gauge": True},
    ...             "eps": {"column": "x", "unit": "%"},
    ...         },
    ...     )
    >>> log["P"].round(3).tolist(), log["time"].tolist()
    ([401325.0, 411325.0, 431325.0], [0.0, 0.01, 0.02])
    """
    overrides = {"time_order": time_order, "duplicates": duplicates, "encoding": encoding}
    mapping, check_units = mapping_for(simulator, mapping, check_units)
    settings = log_settings(mapping, nan, sampling, ambient_pressure=ambient_pressure, **overrides)
    log, notes = read_with_notes(paths, settings, nan=nan, check_units=check_units, max_bytes=max_bytes)
    say_notes(notes, sampling, stacklevel=3)
    return log


def mapping_for(
    simulator: AnySimulator | None, mapping: LogMapping | Mapping[str, Any] | PathLike | None, check_units: bool = True
) -> tuple[LogMapping, bool]:
    """Return a mapping to the ports of a simulator, if it has its own, and whether values must look like their unit."""
    own = {} if simulator is None else {port.source: port.unit or "-" for port in simulator.own_ports}
    return LogMapping.load(mapping, own), check_units and not own


def read_with_notes(
    paths: PathLike | Iterable[PathLike],
    settings: LogMapping,
    *,
    nan: str = "raise",
    check_units: bool = True,
    max_bytes: int = MAX_BYTES,
) -> tuple[pd.DataFrame, Notes]:
    """Read logs as `read_log` does, and return notes instead of warning."""
    files = find_logs(paths)
    notes = Notes()
    frames = []
    for path, tables, zero_run in sources(files, settings, max_bytes, notes.joined):
        frames.append((path, tidy_tables(tables, zero_run, settings, path, nan, check_units, notes)))
    log = pd.concat(_with_unique_names(frames), ignore_index=True)
    note_sampling(log, notes)
    return log, notes


def log_settings(
    mapping: LogMapping | Mapping[str, Any] | PathLike | None,
    nan: str,
    sampling: str,
    *,
    ambient_pressure: float | None = None,
    **overrides: str | None,
) -> LogMapping:
    """Return a checked mapping with the overrides of `read_log`'s arguments."""
    for name, value, offered in (("nan", nan, _NAN), ("sampling", sampling, _SAMPLING)):
        require_one_of(value, offered, f"{name} is {value!r}.", "Correct it.", ParameterError)
    changes: dict[str, Any] = {name: value for name, value in overrides.items() if value is not None}
    if ambient_pressure is not None:
        changes["ambient_pressure"] = float(ambient_pressure)
    settings = replace(LogMapping.load(mapping), **changes)
    settings.validate()
    return settings


def tidy_tables(
    tables: list[RawTable],
    zero_run: pd.DataFrame | None,
    settings: LogMapping,
    path: Path,
    nan: str,
    check_units: bool,
    notes: Notes,
) -> list[pd.DataFrame]:
    """Convert the tables of a file to tidy frames, with missing values, time and units checked."""
    if not tables:
        raise EmptyLogError(f"{path.name} holds no table of samples.", "a table of samples", "Check the export.")
    lost = [text for table in tables for text in table.lost]
    try:
        parts = [tidy(table, zero_run, settings, path, several=len(tables) > 1) for table in tables]
    except MissingColumnError as error:
        if not lost:
            raise
        raise MissingColumnError(f"{error.found} ({'; '.join(lost)})", error.expected, error.remedy) from None
    if told := dict.fromkeys((*lost, *(text for part in parts for text in part.left_out))):
        notes.lost[path.name] = tuple(told)
    for part in parts:
        origin = part.frame
        part.frame = _not_empty(handle_missing(part.frame, nan, path.name), part, path)
        part.frame = handle_time(part.frame, settings.time_order, settings.duplicates, path.name, notes)
        if check_units:
            _require_units(part, settings, path)
        part.frame = screen(
            part.frame,
            origin,
            nan=nan,
            skip=part.unchecked | part.fixed,
            ambient_pressure=settings.ambient_pressure,
            where=path.name,
            notes=notes.readings,
        )
        notes.readings.columns |= part.unread
        if nan == "drop":
            part.frame = _not_empty(handle_missing(part.frame, nan, path.name), part, path)
    return [part.frame for part in parts]


def _not_empty(frame: pd.DataFrame, part: Part, path: Path) -> pd.DataFrame:
    if frame.empty:
        raise EmptyLogError(
            f"{path.name} holds no usable rows{f' in {part.variable}' if part.variable else ''}.",
            "at least two rows",
            "Check skip_rows, allowed and range in the mapping, and what nan='drop' left.",
        )
    return frame


def _require_units(part: Part, settings: LogMapping, path: Path) -> None:
    """Compare the readings with their units, ignoring a few faulty readings of a sensor."""
    ambient = settings.ambient_pressure
    checked = {}
    for name in (c for c in part.frame.columns if c not in part.unchecked and c != "trajectory"):
        values = part.frame[name].to_numpy(dtype=float)
        faults = impossible(str(name), values, ambient)
        checked[str(name)] = values[~faults] if 0.0 < faults.mean() <= _MOST_FAULTS else values
    require_plausible(checked, ambient_pressure=ambient, where=path.name)


def say_notes(notes: Notes, sampling: str, stacklevel: int) -> None:
    """Warn or raise, as requested, about bridged samples; warn of doubtful readings."""
    if doubts := notes.readings.summary():
        warnings.warn(doubts, ReadingWarning, stacklevel=stacklevel)
    for text in notes.losses():
        warnings.warn(f"{text}.", ReadingWarning, stacklevel=stacklevel)
    if how := sentence(notes.joined):
        warnings.warn(f"{how}.", ReadingWarning, stacklevel=stacklevel)
    said = notes.sentences()
    if said and sampling == "raise":
        raise sampling_error(said)
    if said and sampling == "warn":
        warnings.warn("; ".join(said) + ".", SamplingWarning, stacklevel=stacklevel)


def find_logs(paths: PathLike | Iterable[PathLike]) -> list[Path]:
    """List the log files that paths, folders and patterns name, in natural order, each once."""
    if getattr(paths, "columns", None) is not None:
        raise ParameterError(
            f"The log to read is a {type(paths).__name__}, which is a table already.",
            "the name of a file",
            "Pass the table itself to pamid.diagnose or an estimator; pandas and polars are taken.",
        )
    given = [paths] if isinstance(paths, str | Path) else list(paths)
    if not given:
        raise LogNotFoundError("No log is given.", "at least one file", "Pass a file, a folder or a pattern.")
    found: dict[Path, None] = {}
    for item in given:
        if not isinstance(item, str | Path):
            raise ParameterError(f"A path is {item!r}.", "text or a Path", "Pass the name of a file.")
        for path in _expand(Path(item)):
            found[path] = None
    return list(found)


def _expand(path: Path) -> list[Path]:
    try:
        if path.is_dir():
            if episodes := data_set_files(path):
                return episodes
            inside = [p for p in path.iterdir() if p.is_file() and p.suffix.lower() in known_extensions()]
            if not inside:
                raise LogNotFoundError(
                    f"The folder {path} holds no log.",
                    f"files ending in {', '.join(known_extensions())}",
                    "Correct the folder, or name the files.",
                )
            # A JSON file beside logs of another kind holds notes on them, not samples.
            tables = [p for p in inside if p.suffix.lower() != ".json"]
            return sorted(tables or inside, key=lambda p: natural(p.name))
        if path.is_file():
            return [path]
        if any(c in str(path) for c in "*?["):
            base = Path(path.anchor) if path.is_absolute() else Path()
            matches = [p for p in base.glob(str(path.relative_to(path.anchor))) if p.is_file()]
            if matches:
                return sorted(matches, key=lambda p: natural(str(p)))
    except (OSError, ValueError) as error:
        if isinstance(error, LogNotFoundError):
            raise
        raise LogNotFoundError(f"{path} cannot be read: {error}.", "a log file", "Correct the path.") from None
    if path.exists():
        raise LogNotFoundError(
            f"{path} is not a regular file.", "an existing file, folder or pattern", "Write the log to a file first."
        )
    near = ""
    if path.parent.is_dir():
        close = difflib.get_close_matches(path.name, [p.name for p in path.parent.iterdir()], n=1)
        near = f" Did you mean {close[0]}?" if close else ""
    raise LogNotFoundError(f"No log at {path}.", "an existing file, folder or pattern", f"Correct the path.{near}")


def _with_unique_names(frames: list[tuple[Path, list[pd.DataFrame]]]) -> list[pd.DataFrame]:
    """Add ``@file`` to names that several files or variables use."""
    uses = Counter(name for _, parts in frames for part in parts for name in part["trajectory"].unique())
    labels = labels_of([path for path, _ in frames])
    result = []
    taken: set[str] = {name for name, count in uses.items() if count == 1}
    for (_, parts), label in zip(frames, labels, strict=True):
        for part in parts:
            renamed = {name: name for name in part["trajectory"].unique()}
            for name in (n for n in renamed if uses[n] > 1):
                renamed[name] = free_name(f"{name}@{label}" if len(frames) > 1 else name, taken)
                taken.add(renamed[name])
            result.append(with_names(part, renamed))
    return result


def labels_of(paths: list[Path]) -> list[str]:
    """Shortest ends of the paths that distinguish all files."""
    for depth in range(1, max(len(p.parts) for p in paths) + 1):
        labels = ["/".join([*p.parts[-depth:-1], p.stem]) for p in paths]
        if len(set(labels)) == len(paths):
            return labels
    return [str(p) for p in paths]


def write_log(log: pd.DataFrame, path: PathLike) -> Path:
    """Write a tidy frame as parquet, CSV or HDF5, depending on the file's ending.

    Parameters
    ----------
    log : DataFrame
        Columns ``trajectory``, ``time`` and signals, as `read_log` returns it.
    path : str or Path
        File to write: ``.parquet``, ``.csv``, ``.h5``.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    LogFormatError
        If the ending is not one of these.
    ColumnTypeError
        If a run has no name, or one that a file cannot hold.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import pandas as pd
    >>> from pamid.signals import read_log, write_log
    >>> log = pd.DataFrame({"trajectory": ["a", "a"], "time": [0.0, 0.001], "P": [2e5, 3e5]})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     back = read_log(write_log(log, pathlib.Path(folder) / "log.parquet"))
    >>> back.equals(log)
    True
    """
    log, path = as_pandas(log), Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".parquet", ".csv", ".h5"):
        raise LogFormatError(
            f"{path.name} ends in '{suffix}'.", ".parquet, .csv or .h5", "Choose one of these endings."
        )
    log = log.assign(trajectory=_storable(as_names(log["trajectory"]))) if "trajectory" in log else log
    with replacing(path) as draft:
        if suffix == ".parquet":
            log.to_parquet(draft, index=False, write_page_checksum=True)
        elif suffix == ".csv":
            odd = "trajectory" in log and any(n != n.strip() or "\r" in n for n in log["trajectory"].unique())
            log.to_csv(draft, index=False, quoting=csv.QUOTE_NONNUMERIC if odd else csv.QUOTE_MINIMAL)
        else:
            import h5py

            memory = io.BytesIO()  # the HDF5 library itself does not survive a full disk
            with h5py.File(memory, "w") as file:
                group = file.create_group("log", track_order=True)
                for column in log.columns:
                    values = log[column].to_numpy()
                    data = values if values.dtype.kind in "biuf" else values.astype(object)
                    kind = None if values.dtype.kind in "biuf" else h5py.string_dtype()
                    group.create_dataset(str(column), data=data, dtype=kind, fletcher32=kind is None and len(data) > 0)
            draft.write_bytes(memory.getvalue())
    return path


def _storable(names: pd.Series) -> pd.Series:
    """Raise on names that no file can contain, or that would not be read back."""
    for name in names.unique():
        if not name or "\0" in name:
            raise ColumnTypeError(
                f"A run is named {name!r}.", "a text without null characters in every row", "Rename it."
            )
    return names

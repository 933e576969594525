"""Logs larger than memory: files are read in slices, whole runs at a time, or some of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pamid.errors import HostileLogError, InterleavedTrajectoryError, ParameterError
from pamid.explained import explained_by

from ..face import AnySimulator
from ._rows import Notes, free_name, note_sampling, with_names
from ._tidy import TRAJECTORY
from .formats import RawTable, flat_columns, format_of, names_column
from .formats._foreign import whole_file
from .joining import is_joined
from .log import MAX_BYTES, PathLike, find_logs, labels_of, log_settings, mapping_for, read_log, say_notes, tidy_tables
from .mapping import LogMapping
from .thinning import spread_evenly, whole_trajectories

ROWS = 1_000_000
"""Rows of a piece, by default."""

_BATCH = 65_536


@explained_by(read_log)
def read_log_pieces(
    paths: PathLike | Iterable[PathLike],
    mapping: LogMapping | Mapping[str, Any] | PathLike | None = None,
    *,
    rows: int = ROWS,
    nan: str = "raise",
    time_order: str | None = None,
    duplicates: str | None = None,
    sampling: str = "warn",
    check_units: bool = True,
    ambient_pressure: float | None = None,
    encoding: str | None = None,
    max_bytes: int = MAX_BYTES,
    simulator: AnySimulator | None = None,
) -> Iterator[pd.DataFrame]:
    """Read logs as `read_log` does, but piece by piece, each of whole runs.

    Parquet files, and HDF5 files that hold one table of vectors (what `write_log` writes), are read in slices; other
    files as a whole, one after the other. A piece has at most `rows` rows, or one run that is longer. Reading
    and evaluating one needs at most 150 MB and 60 bytes for each of its rows and columns, however long the log. The
    warning on sampling comes after the last piece.

    Parameters
    ----------
    rows : int, default=1000000
        Maximum number of rows of a piece of several runs.
    max_bytes : int, default=16 GiB
        Largest size of a piece in memory.

    Returns
    -------
    iterator of DataFrame
        Tidy frames. A name that an earlier file has used is followed by ``@file``.

    Raises
    ------
    LogError
        As `read_log`; an error in a later piece comes when it is reached.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import pandas as pd
    >>> from pamid.signals import read_log_pieces, write_log
    >>> log = pd.DataFrame({"trajectory": list("aabbcc"), "time": [0.0, 0.001] * 3, "P": [2e5, 2.1e5] * 3})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = write_log(log, pathlib.Path(folder) / "log.parquet")
    ...     [piece["trajectory"].tolist() for piece in read_log_pieces(file, rows=4)]
    [['a', 'a', 'b', 'b'], ['c', 'c']]
    """
    if isinstance(rows, bool) or not isinstance(rows, int | np.integer) or rows < 1:
        raise ParameterError(f"rows is {rows!r}.", "a whole number of at least 1", "Correct it.")
    overrides = {"time_order": time_order, "duplicates": duplicates, "encoding": encoding}
    mapping, check_units = mapping_for(simulator, mapping, check_units)
    settings = log_settings(mapping, nan, sampling, ambient_pressure=ambient_pressure, **overrides)
    return _pieces(find_logs(paths), settings, int(rows), nan, sampling, check_units, max_bytes)


@explained_by(read_log_pieces)
def read_log_part(
    paths: PathLike | Iterable[PathLike],
    mapping: LogMapping | Mapping[str, Any] | PathLike | None = None,
    *,
    most: int,
    nan: str = "raise",
    check_units: bool = True,
    max_bytes: int = MAX_BYTES,
) -> tuple[pd.DataFrame, int]:
    """Read whole runs, evenly spread over a log, up to a maximum number of rows.

    The result equals `whole_trajectories` of what `read_log` returns. Of a parquet file, or an HDF5 file of one table
    of vectors, nothing else is read or kept in memory.

    Parameters
    ----------
    most : int
        Maximum number of rows.
    nan, check_units, max_bytes : optional
        As for `read_log`.

    Returns
    -------
    log : DataFrame
        Tidy frame.
    rows : int
        Rows of the whole log.

    Raises
    ------
    LogError
        As for `read_log`, for the part that is read.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import pandas as pd
    >>> from pamid.signals import read_log_part, write_log
    >>> log = pd.DataFrame({"trajectory": list("aabbccdd"), "time": [0.0, 0.001] * 4, "P": [2e5, 2.1e5] * 4})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     part, rows = read_log_part(write_log(log, pathlib.Path(folder) / "log.parquet"), most=4)
    >>> part["trajectory"].tolist(), rows
    (['a', 'a', 'd', 'd'], 8)
    """
    settings = log_settings(mapping, nan, "warn")
    files = find_logs(paths)
    if len(files) == 1 and files[0].stat().st_size:
        slicer = _SLICERS.get(format_of(files[0], settings.encoding).name)
        sliced = slicer(files[0], settings, 0, max_bytes) if slicer is not None else None
        if sliced is not None and (found := _spread(files[0], sliced, settings, most, nan, check_units)) is not None:
            return found, sliced.rows
    log = read_log(files, settings, nan=nan, check_units=check_units, max_bytes=max_bytes)
    return whole_trajectories(log, most).reset_index(drop=True), len(log)


def _spread(
    path: Path, sliced: Sliced, settings: LogMapping, most: int, nan: str, check_units: bool
) -> pd.DataFrame | None:
    """Read some of the runs of a file; None if they are known only after reading all, or if all are wanted."""
    unordered = settings.time_order == "split" or settings.zero_run is not None
    if sliced.rows <= most or not sliced.sorted or len(sliced.ends) < 2 or unordered:
        return None
    notes = Notes()
    tables = [RawTable(frame) for frame in sliced.read(spread_evenly(np.diff([0, *sliced.ends]), most))]
    parts = [part for table in tables for part in tidy_tables([table], None, settings, path, nan, check_units, notes)]
    log = pd.concat(parts, ignore_index=True)
    note_sampling(log, notes)
    say_notes(notes, "warn", stacklevel=4)
    return log[:most]


@dataclass(frozen=True)
class Sliced:
    """A file that is read in slices."""

    ends: list[int]
    """Row behind the last one of each slice."""
    sorted: bool
    """Whether the rows of each run stand together."""
    read: Callable[[Collection[int] | None], Iterator[pd.DataFrame]]
    """Yields the slices whose numbers it is given, all with None."""

    @property
    def rows(self) -> int:
        """Rows of the file."""
        return self.ends[-1]


def _pieces(
    files: list[Path], settings: LogMapping, rows: int, nan: str, sampling: str, check_units: bool, max_bytes: int
) -> Iterator[pd.DataFrame]:
    notes, taken = Notes(), dict[str, Path]()
    if is_joined(files, settings, max_bytes):
        log = read_log(files, settings, nan=nan, sampling=sampling, check_units=check_units, max_bytes=max_bytes)
        yield from (part.reset_index(drop=True) for _, part in log.groupby(TRAJECTORY, sort=False))
        return
    for path, label in zip(files, labels_of(files), strict=True):
        for tables, zero_run in _raw(path, settings, rows, max_bytes):
            parts = tidy_tables(tables, zero_run, settings, path, nan, check_units, notes)
            frame = pd.concat(parts, ignore_index=True) if len(parts) > 1 else parts[0]
            names = frame[TRAJECTORY].unique()
            if again := [n for n in names if taken.get(n) == path]:
                raise InterleavedTrajectoryError(
                    f"The rows of run '{again[0]}' of {path.name} are not contiguous.",
                    "each run in one block of the file",
                    "Sort the log by run and time, or read it as a whole with read_log.",
                )
            new = {n: free_name(f"{n}@{label}", taken) if n in taken else n for n in names}
            taken |= dict.fromkeys([*names, *new.values()], path)
            frame = with_names(frame, new)
            note_sampling(frame, notes)
            yield frame
    say_notes(notes, sampling, stacklevel=3)


def _raw(
    path: Path, settings: LogMapping, rows: int, max_bytes: int
) -> Iterator[tuple[list[RawTable], pd.DataFrame | None]]:
    """Yield the tables of a file, split between runs if its format allows it."""
    kind = format_of(path, settings.encoding)
    slicer = _SLICERS.get(kind.name)
    sliced = slicer(path, settings, rows, max_bytes) if slicer is not None else None
    if sliced is None:
        yield kind.read(path, settings, max_bytes)
        return
    for frame in sliced.read(None):
        yield [RawTable(frame)], None


def cuts(names: Iterable[np.ndarray], rows: int, met: list[Any] | None = None) -> list[int]:
    """Return where pieces end: after whole runs, before they have too many rows."""
    ends: list[int] = []
    begun, edge, n, last = 0, 0, 0, None
    for part in names:
        changes = np.flatnonzero(part[1:] != part[:-1]) + 1
        if len(part) and n and part[0] != last:
            changes = np.concatenate([[0], changes])
        if met is not None and len(part):
            met += part[changes].tolist() if n else [part[0], *part[changes].tolist()]
        for at in (n + changes).tolist():  # a run ends here
            if at - begun > rows and edge > begun:
                ends.append(edge)
                begun = edge
            edge = at
        if len(part):
            last = part[-1]
        n += len(part)
    if n - begun > rows and edge > begun:
        ends.append(edge)
    return [*ends, n]


def _require_size(path: Path, ends: list[int], columns: int, max_bytes: int) -> None:
    longest = int(np.max(np.diff([0, *ends])))
    if longest * columns * 8 > max_bytes:
        raise HostileLogError(
            f"{path.name} holds a block of {longest} rows of {columns} columns that cannot be cut between "
            f"runs ({longest * columns * 8 / 2**30:.3g} GiB).",
            f"at most {max_bytes / 2**30:.3g} GiB",
            "Name its runs in a column 'trajectory', or raise max_bytes.",
        )


@contextmanager
def _parquet_file(path: Path) -> Iterator[Any]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    # Buffered ahead, all row groups that were read would be kept until the file is closed.
    with (
        whole_file(path, (pa.ArrowException, OSError, ValueError)),
        pq.ParquetFile(path, pre_buffer=False, page_checksum_verification=True) as file,
    ):
        yield file


def _parquet(path: Path, settings: LogMapping, rows: int, max_bytes: int) -> Sliced | None:
    with _parquet_file(path) as file:
        schema, total = file.schema_arrow, file.metadata.num_rows
        flat = flat_columns(schema, settings)
        named = names_column(flat, settings)
        ends, met = [total], list[Any]()
        if named is not None:
            batches = file.iter_batches(batch_size=_BATCH, columns=[flat[named]], use_threads=False)
            ends = cuts((b.column(0).to_numpy(zero_copy_only=False) for b in batches), rows, met)
    if total == 0:
        return None
    _require_size(path, ends, len(flat), max_bytes)
    return Sliced(ends, len(set(met)) == len(met), partial(_parquet_slices, path, flat, ends))


def _parquet_slices(
    path: Path, columns: list[str], ends: list[int], chosen: Collection[int] | None = None
) -> Iterator[pd.DataFrame]:
    import pyarrow as pa

    from .formats.parquet import frame_of

    with _parquet_file(path) as file:
        waiting: list[Any] = []
        held, left = 0, deque(enumerate(b - a for a, b in zip([0, *ends], ends, strict=False)))
        for batch in file.iter_batches(batch_size=_BATCH, columns=columns, use_threads=False):
            waiting.append(batch)
            held += len(batch)
            while left and held >= left[0][1]:
                number, rows = left.popleft()
                table = pa.Table.from_batches(waiting)
                rest = table.slice(rows)
                # Zero-copy slices would keep what is behind them; the last batch alone is copied.
                waiting = rest.to_batches()[-1:] if rest.num_rows else []
                held = rest.num_rows
                if chosen is None or number in chosen:
                    yield frame_of(table.slice(0, rows), path)
                del table, rest


def _hdf5(path: Path, settings: LogMapping, rows: int, max_bytes: int) -> Sliced | None:
    import h5py

    from .formats.hdf5 import collect, is_matlab

    if settings.trajectories is not None or settings.zero_run is not None:
        return None
    with whole_file(path, (OSError,)), h5py.File(path, "r") as file:
        found: dict[str, Any] = {}
        collect(file, "", found, [], depth=0)
        tables = [(name, item) for name, item in found.items() if isinstance(item, dict)]
        if is_matlab(path, file) or len(found) != 1 or len(tables) != 1:
            return None
        group, table = tables[0]
        if any(item.ndim != 1 for item in table.values()):
            return None
        columns = list(table)
        named = names_column(columns, settings)
        total = len(next(iter(table.values())))
        met: list[Any] = []
        ends = [total] if named is None else cuts(_vector(table[columns[named]]), rows, met)
    _require_size(path, ends, len(columns), max_bytes)
    return Sliced(ends, len(set(met)) == len(met), partial(_hdf5_slices, path, group, columns, ends))


def _vector(item: Any) -> Iterator[np.ndarray]:
    for at in range(0, len(item), _BATCH):
        yield _values(item, at, at + _BATCH)


def _values(item: Any, begin: int, end: int) -> np.ndarray:
    import h5py

    return np.asarray(item.asstr()[begin:end] if h5py.check_string_dtype(item.dtype) else item[begin:end])


def _hdf5_slices(
    path: Path, group: str, columns: list[str], ends: list[int], chosen: Collection[int] | None = None
) -> Iterator[pd.DataFrame]:
    import h5py

    with whole_file(path, (OSError,)), h5py.File(path, "r") as file:
        for number, (begin, end) in enumerate(zip([0, *ends], ends, strict=False)):
            if chosen is None or number in chosen:
                yield pd.DataFrame({c: _values(file[group][c], begin, end) for c in columns})


_SLICERS: dict[str, Callable[[Path, LogMapping, int, int], Sliced | None]] = {"parquet": _parquet, "HDF5": _hdf5}

__all__ = ["ROWS", "read_log_part", "read_log_pieces"]

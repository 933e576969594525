"""File formats of logs: one module per format, found automatically.

A module of this package that defines ``FORMAT`` (a `Format`) adds a format; nothing else has to be edited.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pamid._discovery import modules
from pamid._plugins import left_out, plugins
from pamid.errors import EmptyLogError, LogFormatError

if TYPE_CHECKING:
    import pandas as pd

    from ..mapping import LogMapping

TRAJECTORY = "trajectory"
_FEW = 20
"""Rows below which nothing is said of a column by its values."""
HEAD_BYTES = 65_536
"""How much of a file is read to find its format."""


@dataclass
class RawTable:
    """A table as it stands in a file, before names and units are mapped."""

    frame: pd.DataFrame
    """Columns by name, or by position from 0 where the file names none."""
    variable: str | None = None
    """Name of the variable in the file that held it."""
    named: bool = True
    """Whether the columns have names of their own."""
    head: dict[str, Any] = field(default_factory=dict)
    """Single values beside the table, such as ``kp`` in a JSON log."""
    lost: tuple[str, ...] = ()
    """What of the file is not in the table, each a clause, such as "its last message is cut off"."""


@dataclass(frozen=True)
class Format:
    """A file format of logs."""

    name: str
    """What people call it."""
    extensions: tuple[str, ...]
    """Endings of file names, with the dot, in lower case."""
    recognises: Callable[[bytes], bool]
    """Takes the first bytes of a file and says whether it is of this format."""
    read: Callable[[Path, LogMapping, int], tuple[list[RawTable], pd.DataFrame | None]]
    """Takes a path, a mapping and the largest number of bytes to decompress; returns the tables and the zero run or
    None."""
    order: int = 0
    """Formats with clear marks come first (0), text last (9)."""


def names_column(columns: Iterable[Any], mapping: LogMapping) -> int | None:
    """Return the position of the column that names each row's run: it is read as text."""
    labels = [str(c) if isinstance(c, str) else c for c in columns]
    wanted = mapping.run_column
    if isinstance(wanted, int):
        return wanted if 0 <= wanted < len(labels) else None
    if mapping.trajectory is None and any(how.column == TRAJECTORY for how in mapping.signals.values()):
        return None  # the mapping takes it for a signal
    return labels.index(wanted) if wanted in labels else None


def is_measured(column: pd.Series, mapping: LogMapping) -> bool:
    """Return whether a column named like the run column holds readings instead: numbers that change in most rows."""
    import pandas as pd

    unique = column.dropna().unique()
    if mapping.trajectory is not None or len(column) < _FEW:
        return False
    most = 2 * len(unique) > len(column)
    back = mapping.time_order != "sort" and int((column != column.shift()).sum()) > len(unique)
    if not (most or back):
        return False
    try:
        numbers = pd.to_numeric(pd.Series(unique)).to_numpy(dtype=float)
    except (TypeError, ValueError):
        return False
    return most or bool((numbers % 1.0 != 0.0).any())


def flat_columns(schema: Any, mapping: LogMapping) -> list[str]:
    """Return the columns of an Arrow schema that can be signals or name runs; of lists only those of numbers."""
    import pyarrow as pa

    def closed(kind: Any) -> bool:
        is_list = pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind)
        number = is_list and (pa.types.is_floating(kind.value_type) or pa.types.is_integer(kind.value_type))
        return bool(pa.types.is_nested(kind) and not number)

    of_names = names_column(schema.names, mapping)
    flat = [
        field.name
        for k, field in enumerate(schema)
        if not closed(field.type) and (k == of_names or not pa.types.is_binary(field.type))
    ]
    return list(dict.fromkeys(flat))


@cache
def all_formats() -> tuple[Format, ...]:
    """List every format that a module of this package or an installed plug-in defines."""
    found = [getattr(module, "FORMAT", None) for module in modules(__name__)]
    for source, thing in plugins("pamid.readers", "a pamid.signals.formats.Format"):
        if isinstance(thing, Format):
            found.append(thing)
        else:
            left_out(source, repr(thing), "a pamid.signals.formats.Format")
    return tuple(sorted((f for f in found if isinstance(f, Format)), key=lambda f: (f.order, f.name)))


def known_extensions() -> tuple[str, ...]:
    """List the endings of all formats."""
    return tuple(sorted({e for f in all_formats() for e in f.extensions}))


def format_of(path: Path, encoding: str | None = None) -> Format:
    """Recognise a file's format by its content, and compare it with its name."""
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    if not head.strip():
        raise EmptyLogError(f"{path.name} is empty.", "a log with at least two rows", "Record or copy it again.")
    suffix = path.suffix.lower()
    named = [f for f in all_formats() if suffix in f.extensions]
    for candidate in named:
        if candidate.recognises(head):
            return candidate
    by_content = next((f for f in all_formats() if f.recognises(head)), None)
    if by_content is None and encoding is not None:
        by_content, named = next(f for f in all_formats() if ".csv" in f.extensions), []
    if by_content is None:
        raise LogFormatError(
            f"{path.name} holds binary data that no reader knows (it begins with {head[:8]!r}).",
            f"a log in one of {', '.join(f.name for f in all_formats())}",
            "Export the log again in one of these formats."
            if suffix not in (".npz", ".npy", ".pkl", ".pickle", ".joblib")
            else "Files that can carry Python objects are not read; export the log as CSV or parquet.",
        )
    if named:
        raise LogFormatError(
            f"{path.name} is named as {named[0].name}, but its content is {by_content.name}.",
            f"content as the ending {suffix} says",
            f"Rename it to {path.stem}{by_content.extensions[0]}, or export it again.",
        )
    return by_content

"""Data frames of other libraries: those of polars and pyarrow are converted to pandas, lazy ones refused."""

from collections.abc import Collection, Mapping
from itertools import count, islice
from pathlib import PurePath
from typing import Any

from ..errors import ColumnTypeError, ParameterError

_FOREIGN = ("polars", "pyarrow")


def is_foreign(table: Any) -> bool:
    """Return whether a table is a data frame of polars or pyarrow, without importing either."""
    return type(table).__module__.partition(".")[0] in _FOREIGN and getattr(table, "columns", None) is not None


def as_pandas(table: Any) -> Any:
    """Return a data frame of polars or pyarrow as one of pandas, and anything else unchanged."""
    if not is_foreign(table):
        return table
    convert = getattr(table, "to_pandas", None)
    if convert is None:
        raise ColumnTypeError(
            f"The table is a {type(table).__name__} of {type(table).__module__.partition('.')[0]}, which has no "
            "values yet.",
            "a DataFrame of pandas or polars, or an array",
            "Call its collect() first.",
        )
    return convert()


def logs_as_pandas(log: Any, taken: Collection[str] = ()) -> Any:
    """Return a log, or several by name (of a list "log", "log 2", ...), with frames of polars and pyarrow as pandas."""
    if isinstance(log, str | PurePath | list | tuple):
        log = log if isinstance(log, list | tuple) else [log]
        log = dict(zip(free_names(len(log), taken), log, strict=True))
    if isinstance(log, Mapping):
        found = {name: as_pandas(table) for name, table in log.items()}
        if wrong := [name for name, table in found.items() if getattr(table, "columns", None) is None]:
            raise ParameterError(
                f"{wrong[0]!r} is a {type(found[wrong[0]]).__name__}.",
                "a table; several in a list or by name",
                "Read a file with read_log first.",
            )
        return found
    return as_pandas(log)


def free_names(n: int, taken: Collection[str] = ()) -> list[str]:
    """Return names for logs that have none."""
    free = (name for k in count(1) if (name := f"log {k}" if k > 1 else "log") not in taken)
    return list(islice(free, n))

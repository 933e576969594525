"""Data frames of other libraries: those of polars and pyarrow are converted to pandas, lazy ones refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import ColumnTypeError

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


def logs_as_pandas(log: Any) -> Any:
    """Return a log, or several by name, with data frames of polars and pyarrow converted to pandas."""
    if isinstance(log, Mapping):
        return {name: as_pandas(table) for name, table in log.items()}
    return as_pandas(log)

"""From the variables of a MATLAB or HDF5 file to tables: which are runs, and which form one table."""

import fnmatch
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pamid.errors import HostileLogError, MappingError, MissingColumnError

from ..mapping import LogMapping
from . import RawTable
from ._lists import LONGEST

MAX_FOLD = 1_100
"""Largest ratio of decompressed to stored bytes that zlib can reach; a file declaring more is hostile or damaged."""


def require_size(path: Path, name: str, shape: Iterable[int], stored: int, max_bytes: int) -> None:
    """Raise if a variable declares more than may be loaded."""
    declared = 8.0
    for n in shape:
        declared *= max(int(n), 0)
    if declared > max_bytes or declared > 8 * MAX_FOLD * max(stored, 1):
        raise HostileLogError(
            f"{path.name} declares {declared / 2**30:.3g} GiB for the variable '{name}' and has {stored} bytes.",
            f"at most {max_bytes / 2**30:.3g} GiB, and no more than the file can hold",
            "The file is damaged or hostile; export the log again (or raise max_bytes if it is just large).",
        )


def select(path: Path, names: list[str], mapping: LogMapping) -> list[str]:
    """Choose the variables that hold runs, and the zero run as the last one."""
    pattern, zero_run = mapping.trajectories, mapping.zero_run
    chosen = [n for n in names if n != zero_run and (pattern is None or fnmatch.fnmatchcase(n, pattern))]
    if pattern is not None and not chosen:
        raise MappingError(
            f"No variable of {path.name} matches '{pattern}'; it has {', '.join(names[:12]) or 'no numeric variable'}.",
            "variables with runs",
            "Correct trajectories in the mapping.",
        )
    if zero_run is not None and zero_run not in names:
        raise MissingColumnError(
            f"{path.name} has no variable '{zero_run}'; it has {', '.join(names[:12])}.",
            "a zero run under that name",
            "Correct zero_run in the mapping.",
        )
    return [*sorted(chosen, key=natural), *([zero_run] if zero_run else [])]


def natural(text: str) -> list[Any]:
    """Sort key under which ``Test9`` comes before ``Test10``."""
    return [(1, int(t), "") if t.isdigit() else (0, 0, t) for t in re.split(r"(\d+)", text) if t]


def as_frame(value: Any, name: str) -> pd.DataFrame | None:
    """Turn an array of at most two dimensions, or a dict of vectors, into a frame."""
    if isinstance(value, Mapping):
        rows = [np.size(v) for v in value.values() if np.size(v) == max(np.shape(v), default=1)]
        columns = {k: x for name, v in value.items() for k, x in columns_of(str(name), v, max(rows, default=0)).items()}
        return pd.DataFrame(columns) if max(rows, default=0) > 1 else None
    array = np.asarray(value)
    if array.dtype.names is not None and array.ndim <= 2:
        return as_frame({k: array.ravel()[k] for k in array.dtype.names}, name)
    if array.ndim == 1 or (array.ndim == 2 and 1 in array.shape):
        return pd.DataFrame({name: array.ravel()})
    if array.ndim == 2:
        return pd.DataFrame(array)
    return None


def columns_of(name: str, value: Any, rows: int) -> dict[str, np.ndarray]:
    """Return a variable with a number for each row as columns: one, or ``name[0]``, ...; none where it has others."""
    array = np.asarray(value)
    if array.dtype.names is not None:
        parts = {f"{name}/{field}": array[field] for field in array.dtype.names}
        return {k: x for part, v in parts.items() for k, x in columns_of(part, v, rows).items()}
    if array.ndim <= 2 and array.size == rows == max(array.shape, default=1):
        return {name: array.ravel()}
    if array.ndim == 2 and len(array) == rows and array.shape[1] <= LONGEST:
        return {f"{name}[{k}]": array[:, k] for k in range(array.shape[1])}
    return {}


def _beside(name: str, value: Any, rows: int) -> dict[str, np.ndarray]:
    """Return a matrix or table as further columns of others; none where it has a clock or rows of its own."""
    if not isinstance(value, Mapping):
        return columns_of(name, value, rows)
    if "time" in value:
        return {}
    return {k: x for part, v in value.items() for k, x in columns_of(f"{name}/{part}", v, rows).items()}


def _extent(value: Any) -> str:
    """Return the size of a variable in words."""
    return "a table of its own" if isinstance(value, Mapping) else " x ".join(map(str, np.shape(value)))


def tables(
    variables: dict[str, Any], mapping: LogMapping, lost: Sequence[str]
) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Arrange variables into tables and a zero run: each matrix or struct is one, vectors of equal length another."""
    zero = as_frame(variables.pop(mapping.zero_run), mapping.zero_run) if mapping.zero_run else None
    head: dict[str, Any] = {}
    result: list[RawTable] = []
    vectors: dict[str, np.ndarray] = {}
    for name, value in variables.items():
        if isinstance(value, np.ndarray) and value.size == 1 and value.dtype.names is None:
            head.setdefault(name, value.ravel()[0].item())
            continue
        frame = as_frame(value, name)
        if frame is None:
            if np.ndim(value) > 2:
                lost = [*lost, f"'{name}' (an array of {np.ndim(value)} dimensions) left out"]
            continue
        if frame.shape[1] == 1 and mapping.trajectories is None and not isinstance(value, Mapping):
            vectors[name] = frame.iloc[:, 0].to_numpy()
        else:
            named = not all(isinstance(c, int) for c in frame.columns)
            result.append(RawTable(frame, variable=name, named=named, head=head))
    if vectors:
        length = max(len(v) for v in vectors.values())
        columns = {k: v for k, v in vectors.items() if len(v) == length}
        if not result or "time" in columns:
            for other in (table.variable or "" for table in result):
                more = _beside(other, variables[other], length)
                columns |= more
                if not more:
                    lost = [*lost, f"'{other}' ({_extent(variables[other])}, others {length} rows) left out"]
            result = [RawTable(pd.DataFrame(columns), head=head)]
            others = {k: len(v) for k, v in vectors.items() if length // 2 < len(v) < length}
            if others:
                said = ", ".join(f"'{k}' ({n} rows, others {length})" for k, n in list(others.items())[:4])
                lost = [*lost, f"{said} left out"]
    for table in result[:1]:
        table.lost = tuple(lost)
    return result, zero

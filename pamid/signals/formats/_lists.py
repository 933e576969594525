"""Columns whose cells are lists, such as all joints of a robot: each element becomes a column."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

LONGEST = 64
"""Most numbers of one list that become columns."""
_LIST = re.compile(r"^\s*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_ELEMENT = re.compile(r"^(.*\S)\[\d+\]$")
_BETWEEN = re.compile(r"[,;\s]+")


def list_elements(columns: Iterable[str]) -> set[str]:
    """Return the columns that are elements of one list, such as ``q[0]`` and ``q[1]``: the 1 is no unit."""
    stems: dict[str, list[str]] = {}
    for name in columns:
        if match := _ELEMENT.match(name):
            stems.setdefault(match[1], []).append(name)
    return {name for names in stems.values() if len(names) > 1 for name in names}


def unfolded(frame: pd.DataFrame, names: Mapping[str, Sequence[str]] | None = None) -> pd.DataFrame:
    """Return a table with ``name[0]``, ``name[1]``, ... in place of each column of lists."""
    found = {k: block for k in range(frame.shape[1]) if (block := _block(frame.iloc[:, k])) is not None}
    if not found:
        return frame
    columns: dict[Any, Any] = {}
    for k, name in enumerate(frame.columns):
        if k not in found:
            columns[name] = frame.iloc[:, k]
            continue
        called = list((names or {}).get(name, ()))
        places = called if len(set(called)) == found[k].shape[1] else range(found[k].shape[1])
        columns |= {f"{name}[{place}]": found[k][:, j] for j, place in enumerate(places)}
    return pd.DataFrame(columns, index=frame.index)


def _block(column: pd.Series) -> np.ndarray | None:
    """Return the numbers of a column of lists, shape (rows, elements); None if it is no such column."""
    if pd.api.types.is_numeric_dtype(column.dtype) or not len(column):
        return None
    cells = column.to_numpy(dtype=object)
    if isinstance(cells[0], str):
        if not _LIST.match(cells[0]):
            return None
        inside = [match[1] if isinstance(c, str) and (match := _LIST.match(c)) else None for c in cells]
        if any(c is None for c in inside):
            return None
        cells = np.empty(len(inside), dtype=object)
        cells[:] = [_BETWEEN.split(str(c).strip(" ,;")) for c in inside]
    if not all(isinstance(c, list | tuple | np.ndarray) for c in cells):
        return None
    width = len(cells[0])
    if not 0 < width <= LONGEST or any(len(c) != width for c in cells):
        return None
    try:
        block = np.array(cells.tolist(), dtype=float)
    except (ValueError, TypeError):
        return None
    return block if block.ndim == 2 else None

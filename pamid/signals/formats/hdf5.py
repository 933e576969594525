"""HDF5 logs, and MATLAB files of version 7.3, which are HDF5 with transposed arrays."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pamid.errors import ColumnTypeError, HostileLogError, PamidError, TruncatedLogError

from ..mapping import LogMapping
from . import Format, RawTable
from ._variables import require_size, select, tables

if TYPE_CHECKING:
    import h5py


_REFUSED = "links, data in other files and complex numbers are not read: save plain real arrays"
_TEXT = "not numbers"
_SHOWN = 4


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read the numeric data sets; a group of vectors is a table; links to other files and objects are not followed."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            matlab = is_matlab(path, file)
            found: dict[str, Any] = {}
            refused: list[str] = []
            collect(file, "", found, refused, depth=0)
            silent = f"({_TEXT})" if matlab else f"'{mapping.run_column}' ({_TEXT})"
            refused = [r for r in refused if not r.endswith(silent)]
            named = any(isinstance(item, dict) and mapping.run_column in item for item in found.values())
            of_names = {} if named else _names_variable(file, mapping, path, max_bytes, matlab)
            if not found:
                raise HostileLogError(
                    f"{path.name} holds no numeric data set{' but ' + ', '.join(refused[:4]) if refused else ''}.",
                    "numeric data sets",
                    "Objects, references and external links are not read: save plain arrays.",
                )
            wanted = [name for name in select(path, list(found), mapping) if name not in of_names]
            values = {name: _load(found[name], name, path, max_bytes, matlab) for name in wanted} | of_names
    except PamidError:
        raise
    except Exception as error:
        detail = str(error).splitlines()[0][:120] if str(error) else "no detail"
        raise TruncatedLogError(
            f"{path.name} is damaged or cut off ({type(error).__name__}: {detail}).",
            "a complete HDF5 file",
            "Save or copy the log again.",
        ) from None
    lost = [f"{', '.join(refused[:_SHOWN])} left out ({_REFUSED})"] if refused else []
    return tables(values, mapping, lost)


def is_matlab(path: Path, file: h5py.File) -> bool:
    """Return whether MATLAB wrote the file."""
    with path.open("rb") as stream:
        marked = stream.read(6) == b"MATLAB"
    return marked or any("MATLAB_class" in item.attrs for item in _children(file).values())


def _names_variable(
    file: h5py.File, mapping: LogMapping, path: Path, max_bytes: int, matlab: bool
) -> dict[str, np.ndarray]:
    """Return the text variable that names each row's run; a log is never read without these names."""
    import h5py

    wanted = mapping.run_column
    item = _children(file).get(wanted) if isinstance(wanted, str) else None
    if not isinstance(item, h5py.Dataset) or (_numeric(item.dtype) and not (matlab and _class_of(item) == "char")):
        return {}
    require_size(path, str(wanted), item.shape or (1,), item.id.get_storage_size(), max_bytes)
    if matlab and not _is_virtual(item) and _class_of(item) in ("char", "cell"):
        cells = [file[r] for r in item[()].T.ravel(order="F")] if _class_of(item) == "cell" else [item]
        return {str(wanted): np.array([row for cell in cells for row in _characters(cell)], dtype=object)}
    if _is_virtual(item) or not h5py.check_string_dtype(item.dtype) or not _vector(item):
        raise ColumnTypeError(
            f"{path.name} names its runs in '{wanted}', which is of the type {item.dtype}.",
            "text or numbers, one per row",
            "Save it as strings or numbers.",
        )
    return {str(wanted): np.ravel(item.asstr()[()])}


def _class_of(item: h5py.Dataset) -> str:
    found = item.attrs.get("MATLAB_class", b"")
    return found.decode("latin-1") if isinstance(found, bytes) else str(found)


def _characters(item: h5py.Dataset) -> list[str]:
    """Return the rows of MATLAB's character array, stored transposed, with one UTF-16 unit per element."""
    if item.ndim != 2 or item.dtype.kind != "u":
        return [""]
    return [row.astype("<u2").tobytes().decode("utf-16-le", errors="replace").rstrip() for row in item[()].T]


def _members(group: h5py.Group, *, linked: bool = False) -> list[str]:
    """Return the members of a group that lie in this file, or those that are links, which are not followed."""
    import h5py

    own = {n: isinstance(group.get(n, getlink=True), h5py.HardLink) for n in group if not n.startswith("#")}
    return [n for n, here in own.items() if here != linked]


def _children(group: h5py.Group) -> dict[str, Any]:
    return {name: group[name] for name in _members(group)}


def _refused(item: Any) -> str:
    """Return the reason why a data set's numbers cannot be read; empty if they can."""
    if item.shape is None:
        return "empty"
    if _is_virtual(item):
        return "virtual" if item.is_virtual else "external"
    if item.dtype.kind == "c" or (item.dtype.names and any(item.dtype[n].kind == "c" for n in item.dtype.names)):
        return "complex"
    return ""


def collect(
    group: h5py.Group, prefix: str, found: dict[str, Any], refused: list[str], depth: int, above: tuple[Any, ...] = ()
) -> None:
    """Note numeric data sets by their path; a group of vectors and matrices of as many rows is one table."""
    import h5py

    if depth > 8:
        return
    refused.extend(f"'{prefix}{name}' (a link)" for name in _members(group, linked=True))
    for name, item in _children(group).items():
        path = f"{prefix}{name}"
        if isinstance(item, h5py.Dataset):
            if kind := _refused(item):
                refused.append(f"'{path}' ({kind})")
            elif _numeric(item.dtype):
                found[path] = item
            elif item.size > 1:
                refused.append(f"'{path}' ({_TEXT})")
        elif isinstance(item, h5py.Group) and item not in (group, *above):  # else it is within itself
            inner = _children(item)
            sets = {k: v for k, v in inner.items() if isinstance(v, h5py.Dataset) and _vector(v)}
            usable = {
                k: v for k, v in sets.items() if v.size > 1 and (_numeric(v.dtype) or h5py.check_string_dtype(v.dtype))
            }
            sizes = {v.size for v in usable.values()}
            if len(sizes) == 1 and not any(isinstance(v, h5py.Group) for v in inner.values()):
                usable |= {k: v for k, v in inner.items() if k not in usable and _is_block(v, max(sizes))}
                found[path] = usable
                kinds = {k: kind for k, v in inner.items() if k not in usable and (kind := _refused(v) or _shape(v))}
                kinds |= dict.fromkeys(_members(item, linked=True), "a link")
                refused.extend(f"'{path}/{k}' ({kind})" for k, kind in kinds.items())
            else:
                collect(item, f"{path}/", found, refused, depth + 1, (*above, group))


def _is_block(item: h5py.Dataset, rows: int) -> bool:
    """Return whether a data set is a matrix with so many rows, as it is or transposed."""
    return not _refused(item) and _numeric(item.dtype) and item.ndim == 2 and rows in item.shape


def _shape(item: h5py.Dataset) -> str:
    """Return the size of an array of numbers; empty for a single one."""
    return " x ".join(map(str, item.shape)) if _numeric(item.dtype) and item.size > 1 else ""


def _numeric(dtype: np.dtype) -> bool:
    return dtype.kind in "biuf" or (dtype.names is not None and all(dtype[n].kind in "biuf" for n in dtype.names))


def _vector(item: h5py.Dataset) -> bool:
    return (
        item.shape is not None and item.size > 0 and item.size == max(item.shape, default=1) and not _is_virtual(item)
    )


def _is_virtual(item: h5py.Dataset) -> bool:
    """Return whether the data are in other files, which a log may not open."""
    return bool(item.is_virtual) or bool(item.external)


def _load(item: Any, name: str, path: Path, max_bytes: int, matlab: bool) -> Any:
    import h5py

    if isinstance(item, dict):
        return {k: _load(v, f"{name}/{k}", path, max_bytes, matlab) for k, v in item.items()}
    require_size(path, name, item.shape or (1,), item.id.get_storage_size(), max_bytes)
    if h5py.check_string_dtype(item.dtype):
        return np.ravel(item.asstr()[()])
    value = item[()]
    return np.asarray(value).T if matlab else np.asarray(value)


def _recognises(head: bytes) -> bool:
    mark = b"\x89HDF\r\n\x1a\n"
    return head.startswith(mark) or head[512:520] == mark


FORMAT = Format("HDF5", (".h5", ".hdf5", ".hdf", ".mat"), _recognises, read, order=1)

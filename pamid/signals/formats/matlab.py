"""MATLAB logs up to version 7 (``save -v7`` and before); version 7.3 is HDF5."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pamid.errors import HostileLogError, LogFormatError, TruncatedLogError

from . import Format, RawTable
from ._mat5 import contents
from ._variables import as_frame, require_size, select, tables

if TYPE_CHECKING:
    import pandas as pd

    from ..mapping import LogMapping


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read the numeric variables and structs of numeric vectors; objects and cells stay closed."""
    listing = {v.name: v for v in contents(path) if v.name}
    names = [v.name for v in listing.values() if v.kind == "number"]
    structs = [v.name for v in listing.values() if v.kind == "struct"]
    if mapping.trajectories is not None or not names:
        names = names + structs
    if not names:
        kinds = ", ".join(f"{v.name} ({v.kind})" for v in list(listing.values())[:8])
        raise HostileLogError(
            f"{path.name} holds no plain numbers{': ' + kinds if kinds else ''}.",
            "numeric arrays or structs of numeric vectors",
            "Objects, tables and cells are not read: save plain arrays, for instance with table2array.",
        )
    chosen = select(path, names, mapping.trajectories, mapping.zero_run)
    wanted = [*chosen, *([mapping.zero_run] if mapping.zero_run else [])]
    for name in wanted:
        require_size(path, name, listing[name].shape, listing[name].stored, max_bytes)
    content = _load(path, wanted)
    values = {name: _plain(content[name], name, path) for name in wanted if name in content}
    zero = as_frame(values.pop(mapping.zero_run), mapping.zero_run) if mapping.zero_run else None
    return tables(values, pattern_given=mapping.trajectories is not None, head={}), zero


def _load(path: Path, names: list[str]) -> dict[str, Any]:
    import scipy.io

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return scipy.io.loadmat(path, variable_names=names, struct_as_record=True)
    except Exception as error:  # scipy raises whatever the damaged bytes lead it to
        detail = f"{type(error).__name__}: {str(error).splitlines()[0][:120] if str(error) else 'no detail'}"
        raise TruncatedLogError(
            f"{path.name} is damaged or cut off ({detail}).", "a whole MATLAB file", "Save or copy the log again."
        ) from None


def _plain(value: Any, name: str, path: Path) -> Any:
    """Open a struct into a dict of its numeric fields; refuse whatever else is no number."""
    array = np.asarray(value)
    if array.dtype.names is not None:
        if array.size != 1:
            raise LogFormatError(
                f"The variable '{name}' of {path.name} is a struct array of {array.size}.",
                "one struct of numeric vectors",
                "Save one struct a trajectory.",
            )
        cell = array.ravel()[0]
        numeric = {k: np.asarray(cell[k]) for k in array.dtype.names}
        return {k: v for k, v in numeric.items() if v.dtype.kind in "biuf"}
    if array.dtype.kind not in "biuf":
        raise HostileLogError(
            f"The variable '{name}' of {path.name} holds {array.dtype}.", "real numbers", "Save plain arrays."
        )
    return array


FORMAT = Format("MATLAB", (".mat",), lambda head: head[:10] == b"MATLAB 5.0", read)

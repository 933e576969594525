"""MATLAB logs up to version 7 (``save -v7`` and before); version 7.3 is HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pamid.errors import HostileLogError

from . import Format, RawTable
from ._mat5 import contents, load
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
    values = {name: load(path, listing[name], max_bytes) for name in wanted}
    zero = as_frame(values.pop(mapping.zero_run), mapping.zero_run) if mapping.zero_run else None
    return tables(values, pattern_given=mapping.trajectories is not None, head={}), zero


FORMAT = Format("MATLAB", (".mat",), lambda head: head[:10] == b"MATLAB 5.0", read)

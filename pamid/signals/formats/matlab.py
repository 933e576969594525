"""MATLAB logs up to version 7 (``save -v7`` and before); version 7.3 is HDF5."""

from pathlib import Path

import pandas as pd

from pamid.errors import ColumnTypeError, HostileLogError

from ..mapping import LogMapping
from . import Format, RawTable
from ._mat5 import Variable, contents, load
from ._variables import require_size, select, tables


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read the numeric variables, structs of vectors and names of runs; objects and other cells are not read."""
    listing = {v.name: v for v in contents(path) if v.name}
    of_names = _names_variable(listing, mapping, path)
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
    wanted = [*select(path, names, mapping), *of_names]
    for name in wanted:
        require_size(path, name, listing[name].shape, listing[name].stored, max_bytes)
    complex_ones = [name for name, v in listing.items() if v.kind == "complex"]
    values = {name: load(path, listing[name], max_bytes, complex_ones) for name in wanted}
    shown = ", ".join(f"'{name}'" for name in complex_ones[:4])
    lost = [f"{shown} left out (complex numbers are not read: save real parts)"] if complex_ones else []
    return tables(values, mapping, lost)


def _names_variable(listing: dict[str, Variable], mapping: LogMapping, path: Path) -> list[str]:
    """Return the text variable that names each row's run; a log is never read without these names."""
    wanted = mapping.run_column
    kind = listing[wanted].kind if isinstance(wanted, str) and wanted in listing else "number"
    if kind in ("char", "cell"):
        return [str(wanted)]
    if kind not in ("number", "struct"):
        raise ColumnTypeError(
            f"{path.name} names its runs in '{wanted}', which is of the class {kind}.",
            "numbers, a character array or a cell of character vectors",
            f"Save it as text: {wanted} = cellstr({wanted}).",
        )
    return []


FORMAT = Format("MATLAB", (".mat",), lambda head: head[:10] == b"MATLAB 5.0", read)

"""Text tables: fields separated by commas, semicolons, tabs or blanks; with or without header; point or comma."""

import csv
import itertools
import re
from pathlib import Path
from typing import Any

import pandas as pd

from pamid.errors import ColumnTypeError, EmptyLogError, HostileLogError, LogFormatError

from ..mapping import LogMapping
from . import Format, RawTable, is_measured, names_column
from ._encoding import encoding_by
from ._fields import require_fields
from ._layout import MISSING, Layout, layout_of
from ._lists import unfolded

_BLANK = r"\s+"
_NO_NUMBER = (
    "", "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "-nan(ind)", "1.#IND", "1.#QNAN", "<NA>",
    "N/A", "NA", "NULL", "NaN", "None", "n/a", "nan", "nan(ind)", "null",
)  # fmt: skip
_SHOWN = 40
_FOREIGN = 0.05
_NUMBERLIKE = re.compile(r"(^|\s)[+-]?\d+[.,]?\d*(\s|$)")


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read a text table."""
    if path.stat().st_size > max_bytes:
        raise HostileLogError(
            f"{path.name} has {path.stat().st_size / 2**30:.3g} GiB of text.",
            f"at most {max_bytes / 2**30:.3g} GiB",
            "Split the log or convert it to parquet, or raise max_bytes.",
        )
    try:
        layout = layout_of(path, mapping)
        require_fields(path, layout)
        of_names = names_column(layout.names or range(layout.width), mapping)
        frame = _parsed(path, layout, of_names)
    except pd.errors.EmptyDataError:
        raise EmptyLogError(f"{path.name} holds no rows.", "a table of samples", "Record the log again.") from None
    except (csv.Error, pd.errors.ParserError, UnicodeError, OverflowError) as error:
        raise LogFormatError(
            f"{path.name} cannot be read as text: {' '.join(str(error).split())[:160]}.",
            "a text table",
            "Export the log again, or set delimiter in the mapping.",
        ) from None
    if of_names is not None:
        names: Any = _with_blanks(frame.iloc[:, of_names], path, layout, of_names)
        frame.isetitem(of_names, names)
        of_names = None if is_measured(names.str.replace(layout.decimal, ".", regex=False), mapping) else of_names
    for position in range(layout.width):
        column = frame.iloc[:, position]
        if position != of_names and not pd.api.types.is_numeric_dtype(column.dtype):
            frame.isetitem(position, _numbers(column, layout.decimal, mapping.thousands, path))
    if layout.names is not None:
        frame = unfolded(frame)
    return [RawTable(frame, named=layout.names is not None)], None


def _parsed(path: Path, layout: Layout, of_names: int | None) -> pd.DataFrame:
    """Return the table as pandas reads it, with the column of run names as text."""
    positions = [str(k) for k in range(layout.width)]
    missing = {k: _NO_NUMBER for k in positions if k != str(of_names)}
    # Before 3.1 pandas reads some numbers one bit beside what was written; from then on it warns of this argument.
    version = tuple(int(part) for part in pd.__version__.split(".")[:2])
    exactly: dict[str, Any] = {"float_precision": "round_trip"} if version < (3, 1) else {}
    with path.open(encoding=layout.encoding, newline="") as stream:
        for _ in range(layout.begins):
            stream.readline()
        frame = pd.read_csv(
            stream,
            sep=layout.delimiter if layout.delimiter != " " else _BLANK,
            header=None,
            names=[*positions, "behind"] if layout.ends_with_delimiter else positions,
            usecols=positions,
            dtype={str(of_names): "str"} if of_names is not None else None,
            decimal=layout.decimal,
            thousands=None,
            index_col=False,
            skipinitialspace=True,
            engine="c",
            low_memory=False,
            na_values=missing,
            keep_default_na=False,
            **exactly,
        )
    frame.columns = pd.Index(layout.names or range(layout.width))
    return frame


def _with_blanks(names: pd.Series, path: Path, layout: Layout, position: int) -> pd.Series:
    """Return the names of runs, with leading blanks if only these distinguish two runs."""
    if layout.delimiter == " " or not _blanks_in_front(path, layout):
        return names
    with path.open(encoding=layout.encoding, newline="") as stream:
        rows = list(csv.reader(itertools.islice(stream, layout.begins, None), delimiter=layout.delimiter))
    written = [row[position] for row in rows if len(row) > max(position, 1)]
    if len(written) != len(names) or len(set(written)) == len({text.lstrip() for text in written}):
        return names
    return pd.Series(written, index=names.index, dtype="str")


def _blanks_in_front(path: Path, layout: Layout) -> bool:
    """Return whether a field may begin with a blank."""
    wide = "utf-16-le" if layout.encoding.startswith("utf-16") else "utf-8"
    sought = [f"{mark} ".encode(wide) for mark in (layout.delimiter, "\n")]
    rest = b""
    with path.open("rb") as stream:
        while piece := stream.read(2**22):
            if any(text in rest + piece for text in sought):
                return True
            rest = piece[-4:]
    return False


def _numbers(column: pd.Series, decimal: str, thousands: str | None, path: Path) -> Any:
    """Convert a column that pandas left as text to numbers, if it is meant as numbers."""
    text = column.astype(str).str.strip()
    if thousands:
        text = _without_thousands(text, decimal, thousands)
    missing = column.isna() | text.str.lower().isin(MISSING - {"inf", "-inf", "+inf", "infinity", "-infinity"})
    numbers = pd.to_numeric(text.str.replace(decimal, ".", regex=False).where(~missing), errors="coerce")
    bad = numbers.isna() & ~missing
    if not bad.any():
        return numbers
    if bad.sum() > 0.5 * len(column):
        several = text[bad].head(1000).str.fullmatch(r"[+-]?\d{1,3}([.,']\d{3})+([.,]\d+)?")
        if several.all():
            mark = "." if "." in str(text[bad].iloc[0]) else ","
            raise ColumnTypeError(
                f"Column '{column.name}' of {path.name} holds numbers such as {text[bad].iloc[0][:_SHOWN]!r}.",
                "numbers with one decimal point",
                f"If they carry thousands points, set thousands = '{mark}' in the mapping.",
            )
        return column
    if not numbers.notna().any() and not _NUMBERLIKE.search(" ".join(text[bad].head(1000))):
        return column  # remarks: words here and there, and no number
    row = int(bad.to_numpy().argmax())
    hint = (
        "If these are thousands points, set thousands = '.' in the mapping."
        if re.fullmatch(r"[+-]?\d{1,3}(\.\d{3})+\.\d+", text.iloc[row])
        else "Correct the rows, or leave the column out of the mapping."
    )
    raise ColumnTypeError(
        f"Column '{column.name}' of {path.name} holds text in {int(bad.sum())} of {len(column)} rows; the first is "
        f"{text.iloc[row][:_SHOWN]!r} in row {row + 1}.",
        "numbers",
        hint,
    )


def _without_thousands(text: pd.Series, decimal: str, thousands: str) -> pd.Series:
    """Remove thousands separators; if they look like the decimal point, the last one is the decimal point."""
    if thousands != decimal:
        return text.str.replace(thousands, "", regex=False)
    return text.str.replace(rf"{re.escape(thousands)}(?=.*{re.escape(decimal)})", "", regex=True)


def _recognises(head: bytes) -> bool:
    if not head.strip() or head.startswith((b"PAR1", b"\x89HDF", b"PK\x03\x04", b"\x1f\x8b", b"\x80\x04", b"\x80\x05")):
        return False
    found = encoding_by(head)
    if found == "latin-1" and sum(b > 127 for b in head[:4096]) > _FOREIGN * len(head[:4096]):
        return b"\n" in head and any(b in head for b in b"0123456789")
    return bool(found)


FORMAT = Format("text (CSV)", (".csv", ".txt", ".tsv", ".dat", ".log", ".asc"), _recognises, read, order=9)

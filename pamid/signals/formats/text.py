"""Text tables: CSV, semicolons, tabs or blanks between columns, with or without a header, points or commas."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pamid.errors import (
    ColumnTypeError,
    DuplicateColumnError,
    EmptyLogError,
    HostileLogError,
    LogFormatError,
    TruncatedLogError,
)

from . import Format, RawTable

if TYPE_CHECKING:
    import pandas as pd

    from ..mapping import LogMapping

_NUMBER = re.compile(r"^[+-]?(\d+([.,]\d*)*|[.,]\d+)([eEdD][+-]?\d+)?$")
_MISSING = {"", "nan", "na", "n/a", "null", "none", "inf", "-inf", "+inf", "-nan", "infinity", "-infinity"}
_BLANK = r"\s+"


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read a text table."""
    import pandas as pd

    if path.stat().st_size > max_bytes:
        raise HostileLogError(
            f"{path.name} has {path.stat().st_size / 2**30:.3g} GiB of text.",
            f"at most {max_bytes / 2**30:.3g} GiB",
            "Split the log or convert it to parquet, or raise max_bytes.",
        )
    encoding = _encoding(path)
    lines = _first_lines(path, encoding)
    if not lines:
        raise EmptyLogError(f"{path.name} holds no rows.", "a table with at least two rows", "Record the log again.")
    delimiter = mapping.delimiter or _delimiter([line for _, line in lines])
    split = _splitter(delimiter)
    header = _has_header(split(lines[0][1]), mapping.header)
    names = [_clean(t) for t in split(lines[0][1])] if header else None
    if names is not None:
        _require_unique(names, path)
    body = lines[1:] if header else lines
    if not body:
        raise EmptyLogError(f"{path.name} holds a header and no rows.", "a table of samples", "Record the log again.")
    width = len(names) if names is not None else len(split(body[0][1]))
    _require_whole(path, encoding, split, width)
    decimal = mapping.decimal or _decimal([split(line) for _, line in body], delimiter)
    try:
        frame = pd.read_csv(
            path,
            sep=delimiter if delimiter != " " else _BLANK,
            header=None,
            names=list(names) if names is not None else None,
            skiprows=lines[0][0] + bool(header),
            decimal=decimal,
            thousands=None,
            encoding=encoding,
            index_col=False,
            skipinitialspace=True,
            engine="c",
            comment="#",
            low_memory=False,
            na_values=["-nan", "nan(ind)", "-nan(ind)"],
        )
    except pd.errors.ParserError as error:
        raise LogFormatError(
            f"{path.name}: {_parser_message(str(error))}.",
            f"{width} fields in every row",
            "Correct the row, or set delimiter in the mapping.",
        ) from None
    except pd.errors.EmptyDataError:
        raise EmptyLogError(f"{path.name} holds no rows.", "a table of samples", "Record the log again.") from None
    except (UnicodeDecodeError, ValueError, OverflowError) as error:
        raise LogFormatError(
            f"{path.name} cannot be read as text: {str(error)[:160]}.", "a text table", "Export the log again."
        ) from None
    if width > 1 and frame.shape[1] > 1 and frame.iloc[:, -1].isna().all() and _ends_with_delimiter(body, delimiter):
        frame = frame.iloc[:, :-1]
    for position, column in enumerate(frame.columns):
        if not pd.api.types.is_numeric_dtype(frame[column].dtype):
            frame.isetitem(position, _numbers(frame[column], decimal, mapping.thousands, path))
    return [RawTable(frame, named=names is not None)], None


def _encoding(path: Path) -> str:
    with path.open("rb") as stream:
        head = stream.read(65_536)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:
            return "latin-1"
    return "utf-8-sig"


def _first_lines(path: Path, encoding: str, count: int = 400) -> list[tuple[int, str]]:
    """Return the first rows with their line numbers, without blank lines and comments."""
    lines: list[tuple[int, str]] = []
    with path.open(encoding=encoding, errors="replace", newline=None) as stream:
        for number, line in enumerate(stream):
            text = line.strip("\r\n")
            if text.strip() and not text.lstrip().startswith("#"):
                lines.append((number, text))
            if len(lines) >= count or number > 20 * count:
                break
    return lines


def _delimiter(lines: list[str]) -> str:
    """Choose the separator that splits the rows into the same number of fields, more than one."""
    sample = lines[1:] if len(lines) > 1 else lines
    best, score = " ", (0.0, 0.0)
    for candidate in (";", "\t", ",", "|", " "):
        counts = Counter(len(_splitter(candidate)(line)) for line in sample)
        width, hits = counts.most_common(1)[0]
        if width < 2:
            continue
        share = hits / len(sample)
        if candidate == "," and ";" in sample[0]:
            share *= 0.5  # a comma beside semicolons is a decimal comma
        if (rank := (round(share, 1), float(width) if candidate not in " ," else 0.0)) > score:
            best, score = candidate, rank
    return best


def _splitter(delimiter: str) -> Callable[[str], list[str]]:
    if delimiter in (" ", _BLANK):
        return str.split
    return lambda line: line.split(delimiter)


def _has_header(tokens: list[str], given: bool | None) -> bool:
    if given is not None:
        return given
    return not any(_NUMBER.match(_clean(t)) for t in tokens) and any(_clean(t).lower() not in _MISSING for t in tokens)


def _clean(token: str) -> str:
    return token.strip().strip("\"'").strip()


def _require_unique(names: list[str], path: Path) -> None:
    double = [n for n, k in Counter(names).items() if k > 1 and n]
    if double:
        raise DuplicateColumnError(
            f"{path.name} has {Counter(names)[double[0]]} columns named '{double[0]}'.",
            "each column's name once",
            "Rename one of them in the header, or set header = false and map columns by position.",
        )


def _require_whole(path: Path, encoding: str, split: Callable[[str], list[str]], width: int) -> None:
    """Raise if the last row has fewer fields than the others: the file was cut off."""
    with path.open("rb") as stream:
        stream.seek(0, io.SEEK_END)
        size = stream.tell()
        stream.seek(max(0, size - 16_384))
        tail = stream.read()
    text = tail.decode("utf-16-le" if encoding == "utf-16" else encoding.removesuffix("-sig"), errors="replace")
    rows = [row for row in text.splitlines() if row.strip()]
    if len(rows) > 1 and len(split(rows[-1])) < width and not rows[-1].lstrip().startswith("#"):
        raise TruncatedLogError(
            f"The last row of {path.name} has {len(split(rows[-1]))} of {width} fields: {rows[-1][:60]!r}.",
            "a whole last row",
            "The log was cut off: copy it again, or delete its last row.",
        )


def _decimal(rows: list[list[str]], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    tokens = [_clean(t) for row in rows for t in row]
    commas = sum(bool(re.match(r"^[+-]?\d*,\d+([eE][+-]?\d+)?$", t)) for t in tokens)
    points = sum("." in t for t in tokens)
    return "," if commas > points else "."


def _ends_with_delimiter(body: list[tuple[int, str]], delimiter: str) -> bool:
    return delimiter != " " and all(line.rstrip(" ").endswith(delimiter) for _, line in body)


def _numbers(column: pd.Series, decimal: str, thousands: str | None, path: Path) -> Any:
    """Turn a column that pandas left as text into numbers where it is meant as numbers."""
    import pandas as pd

    text = column.astype(str).str.strip()
    if thousands:
        text = _without_thousands(text, decimal, thousands)
    missing = column.isna() | text.str.lower().isin(_MISSING - {"inf", "-inf", "+inf", "infinity", "-infinity"})
    numbers = pd.to_numeric(text.str.replace(decimal, ".", regex=False).where(~missing), errors="coerce")
    bad = numbers.isna() & ~missing
    if not bad.any():
        return numbers
    if bad.sum() > 0.5 * len(column):
        several = text[bad].head(1000).str.fullmatch(r"[+-]?\d{1,3}([.,']\d{3})+([.,]\d+)?")
        if several.all():
            mark = "." if "." in str(text[bad].iloc[0]) else ","
            raise ColumnTypeError(
                f"Column '{column.name}' of {path.name} holds numbers such as {text[bad].iloc[0]!r}.",
                "numbers with one decimal point",
                f"If they carry thousands points, set thousands = '{mark}' in the mapping.",
            )
        return column
    row = int(bad.to_numpy().argmax())
    hint = (
        "If these are thousands points, set thousands = '.' in the mapping."
        if re.fullmatch(r"[+-]?\d{1,3}(\.\d{3})+\.\d+", text.iloc[row])
        else "Correct the rows, or leave the column out of the mapping."
    )
    raise ColumnTypeError(
        f"Column '{column.name}' of {path.name} holds text in {int(bad.sum())} of {len(column)} rows; the first is "
        f"{text.iloc[row]!r} in row {row + 1}.",
        "numbers",
        hint,
    )


def _without_thousands(text: pd.Series, decimal: str, thousands: str) -> pd.Series:
    """Remove the marks of thousands; where they look like the decimal point, the last one is the decimal point."""
    if thousands != decimal:
        return text.str.replace(thousands, "", regex=False)
    return text.str.replace(rf"{re.escape(thousands)}(?=.*{re.escape(decimal)})", "", regex=True)


def _parser_message(message: str) -> str:
    match = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", message)
    return f"line {match[2]} has {match[3]} fields where {match[1]} were expected" if match else message[:160]


def _recognises(head: bytes) -> bool:
    if not head.strip():
        return False
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    if b"\x00" in head or head.startswith((b"PAR1", b"\x89HDF", b"PK\x03\x04", b"\x1f\x8b", b"\x80\x04", b"\x80\x05")):
        return False
    control = sum(b < 32 and b not in (9, 10, 11, 12, 13, 27) for b in head[:4096])
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4 and sum(b > 127 for b in head[:4096]) > 0.05 * len(head[:4096]):
            return False
    return control == 0


FORMAT = Format("text (CSV)", (".csv", ".txt", ".tsv", ".dat", ".log", ".asc"), _recognises, read, order=9)

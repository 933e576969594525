"""The layout of a text table: encoding, what is above its rows, delimiter, names of columns, fields per row."""

import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from pamid.errors import DuplicateColumnError, EmptyLogError, LogFormatError, MappingError

from ..mapping import LogMapping
from ..unit_names import unit_name
from ._encoding import encoding_of

NUMBER = re.compile(r"^[+-]?(\d+([.,]\d*)*|[.,]\d+)([eEdD][+-]?\d+)?$")
MISSING = {"", "nan", "na", "n/a", "null", "none", "inf", "-inf", "+inf", "-nan", "infinity", "-infinity"}
_LINES = 400
_COMMENT = "#"
_ALIKE = 3  # rows that have to look like samples before the first of them counts as one


class Layout(NamedTuple):
    """How to read a text table."""

    encoding: str
    delimiter: str
    names: tuple[str, ...] | None
    width: int
    begins: int
    decimal: str
    ends_with_delimiter: bool


def layout_of(path: Path, mapping: LogMapping) -> Layout:
    """Find the layout of a text table from its first rows and the mapping."""
    encoding = mapping.encoding or encoding_of(path)
    lines = _first_lines(path, encoding)
    above = len(list(itertools.takewhile(lambda line: _is_comment(line) or not line.strip(), lines)))
    comments, rest = lines[:above], lines[above:]
    if not any(line.strip() for line in rest):
        comments, rest = [], lines  # every line begins with the mark: it is part of the first field
    if not any(line.strip() for line in rest):
        raise EmptyLogError(f"{path.name} holds no rows.", "a table with at least two rows", "Record the log again.")
    delimiter = _given(mapping.delimiter) or _delimiter(rest)
    rows = list(numbered_rows(rest, delimiter))
    names, above = _names_above([[clean(t) for t in row] for _, row in rows], mapping.header)
    begins = len(comments)
    if above:
        begins, rows = begins + rows[above - 1][0], rows[above:]
    else:
        begins -= _rows_among(comments, delimiter, len(rows[0][1]))
    if not rows:
        raise EmptyLogError(f"{path.name} holds a header and no rows.", "a table of samples", "Record the log again.")
    fields = [row for _, row in rows]
    usual = Counter(map(len, fields)).most_common(1)[0][0]
    behind = delimiter != " " and usual > 1 and all(not row[-1].strip() for row in fields if len(row) == usual)
    if names is not None:
        if behind and len(names) == usual and not names[-1]:
            names = names[:-1]
        behind = behind and usual == len(names) + 1
        _require_unique(names, path)
    decimal = mapping.decimal or _decimal(fields, delimiter)
    width = len(names) if names is not None else usual - behind
    return Layout(encoding, delimiter, names, width, begins, decimal, behind)


def _names_above(rows: Sequence[Sequence[str]], header: bool | None) -> tuple[tuple[str, ...] | None, int]:
    """Return the names of columns, None where there are none, and the number of rows above the samples."""
    if header is None and (heading := _heading(rows)) is not None:
        return heading
    if header is None:
        first = rows[0]
        header = not any(NUMBER.match(t) for t in first) and any(t.lower() not in MISSING for t in first)
    return (tuple(rows[0]), 1) if header else (None, 0)


def _heading(rows: Sequence[Sequence[str]]) -> tuple[tuple[str, ...], int] | None:
    """Find the names of columns, with the units below them, and the number of rows above the samples."""
    width = Counter(len(row) for row in rows).most_common(1)[0][0]
    if width < 2:
        return None

    def is_sample(row: Sequence[str]) -> bool:
        return len(row) == width and sum(map(_is_value, row)) >= max(1, (width + 1) // 2)

    first = next((k for k in range(len(rows)) if all(map(is_sample, rows[k : k + _ALIKE]))), 0)

    def is_names(k: int) -> bool:
        return 0 <= k < first and len(rows[k]) == width and not any(_is_value(t) for t in rows[k] if t) and any(rows[k])

    if not is_names(first - 1):
        return None
    units = [unit_name(_bare(t)) for t in rows[first - 1]]
    told = [t for t in rows[first - 1] if t]
    if is_names(first - 2) and sum(u is not None for u in units) >= max(1, (len(told) + 1) // 2):
        names = [
            f"{name} [{_bare(unit)}]" if unit and name else name
            for name, unit in zip(rows[first - 2], rows[first - 1], strict=True)
        ]
        return tuple(names), first
    return (tuple(rows[first - 1]), first) if first > 1 else None


def _bare(text: str) -> str:
    """Return a unit without the brackets around it."""
    return text.strip().removeprefix("[").removeprefix("(").removesuffix("]").removesuffix(")").strip()


def _given(delimiter: str | None) -> str | None:
    """Return the mapping's delimiter; a blank stands for white space of any length."""
    if delimiter is None or delimiter == r"\s+":
        return delimiter and " "
    if len(delimiter) != 1 or delimiter in '\r\n"':
        raise MappingError(f"delimiter is {delimiter!r}.", "one character between fields, or '\\s+'", "Correct it.")
    return delimiter


def numbered_rows(lines: Iterable[str], delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Split lines into rows of fields, skipping blank lines."""
    if delimiter == " ":
        for number, line in enumerate(lines, start=1):
            if line.strip():
                yield number, _at_blanks(line)
        return
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
    for row in reader:
        if row and (len(row) > 1 or row[0].strip()):
            yield reader.line_num, row


def _at_blanks(line: str) -> list[str]:
    if '"' not in line:
        return line.split()
    return next(csv.reader([" ".join(line.split("\t")).strip()], delimiter=" ", skipinitialspace=True))


def clean(token: str) -> str:
    """Return a field without blanks and quotes around it."""
    return token.strip().strip("\"'").strip()


def _first_lines(path: Path, encoding: str) -> list[str]:
    """Return enough first lines to contain some samples below any comments."""
    lines: list[str] = []
    left = _LINES
    with path.open(encoding=encoding, errors="replace", newline=None) as stream:
        for line in stream:
            longest = max(map(len, re.split(r"[;,|\s]", line))) if len(line) > csv.field_size_limit() else 0
            if longest > csv.field_size_limit():
                raise LogFormatError(
                    f"{path.name}: line {len(lines) + 1} holds {longest:,} characters without a delimiter.",
                    f"fields of at most {csv.field_size_limit():,} characters",
                    "Correct or remove the row.",
                )
            lines.append(line)
            left -= bool(line.strip()) and not (left == _LINES and _is_comment(line))
            if not left or len(lines) > 20 * _LINES:
                break
    return lines


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENT)


def _rows_among(comments: list[str], delimiter: str, width: int) -> int:
    """Return how many of the last commented lines above a table without header are rows of it."""
    count = 0
    for line in reversed(comments):
        fields = next(numbered_rows([line], delimiter), (0, []))[1]
        if len(fields) != width or width < 2 or not all(NUMBER.match(clean(t)) for t in fields[1:]):
            break
        count += 1
    return count


def _delimiter(lines: list[str]) -> str:
    """Choose the separator that splits header and rows into the same number of fields, more than one."""
    lines = [line for line in lines if line.strip()]
    best, score = " ", (False, 0.0, 0.0)
    for candidate in (";", "\t", ",", "|", " "):
        first, *rest = [len(row) for _, row in _tolerant_rows(lines, candidate)] or [0]
        counts = Counter(rest or [first])
        width, hits = counts.most_common(1)[0]
        if width < 2:
            continue
        share = hits / sum(counts.values())
        if candidate == "," and ";" in lines[-1]:
            share *= 0.5  # a comma beside semicolons is a decimal comma
        rank = (first == width, round(share, 1), float(width) if candidate not in " ," else 0.0)
        if rank > score:
            best, score = candidate, rank
    return best


def _tolerant_rows(lines: list[str], delimiter: str) -> list[tuple[int, list[str]]]:
    """Return the rows that a trial delimiter gives; none where the text cannot be split by it."""
    try:
        return list(numbered_rows(lines, delimiter))
    except csv.Error:
        return []


def _is_value(token: str) -> bool:
    return bool(NUMBER.match(token)) or token.lower() in MISSING


def _require_unique(names: tuple[str, ...], path: Path) -> None:
    double = [n for n, k in Counter(names).items() if k > 1 and n]
    if double:
        raise DuplicateColumnError(
            f"{path.name} has {Counter(names)[double[0]]} columns named '{double[0]}'.",
            "each column's name once",
            "Rename one of them in the header, or set header = false and map columns by position.",
        )


def _decimal(rows: list[list[str]], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    tokens = [clean(t) for row in rows for t in row]
    commas = sum(bool(re.match(r"^[+-]?\d*,\d+([eE][+-]?\d+)?$", t)) for t in tokens)
    points = sum("." in t for t in tokens)
    return "," if commas > points else "."

"""Whether every row of a text table has as many fields as its header: none is dropped or invented."""

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pamid.errors import LogFormatError, TruncatedLogError

from ._layout import Layout, numbered_rows

_CHUNK = 2**24
_SHOWN = 60
_WIDE = re.compile(r"utf[-_]?(16|32)|u16|u32|utf-7|big5|shift|gb|cp9|euc")
"""Encodings in which a byte of a delimiter may be part of another letter."""


class _Counts:
    """Rows with another number of fields: how many, the first one, and whether it is the last row."""

    def __init__(self, layout: Layout) -> None:
        self.allowed = {layout.width, layout.width + layout.ends_with_delimiter}
        self.rows = self.odd = 0
        self.first = (0, 0)
        self.last_is_odd = False

    def add(self, lines: np.ndarray, counts: np.ndarray) -> None:
        if not len(counts):
            return
        odd = ~np.isin(counts, list(self.allowed))
        if odd.any() and not self.odd:
            at = int(odd.argmax())
            self.first = int(lines[at]), int(counts[at])
        self.odd += int(odd.sum())
        self.rows += len(counts)
        self.last_is_odd = bool(odd[-1])


def require_fields(path: Path, layout: Layout) -> None:
    """Raise where a row has more or fewer fields than the header, or than most rows where there is none."""
    found = _counted(path, layout)
    if not found.odd:
        return
    line, count = found.first
    if found.odd == 1 and found.last_is_odd and count < layout.width:
        raise TruncatedLogError(
            f"The last row of {path.name} has {count} of {layout.width} fields: {_text_of(path, layout, line)!r}.",
            "a complete last row",
            "The log was cut off: copy it again, or delete its last row.",
        )
    as_expected = "the header names" if layout.names is not None else "most rows have"
    so_many = f"; {found.odd} of {found.rows} rows are like this" if found.odd > 1 else ""
    raise LogFormatError(
        f"{path.name}: line {line} has {count} field{'' if count == 1 else 's'} where {as_expected} {layout.width}"
        f"{so_many}.",
        f"{layout.width} fields in every row",
        "Name the further columns in the header, or remove them."
        if found.odd == found.rows and count > layout.width
        else "Correct or remove the row, or set delimiter in the mapping.",
    )


def _counted(path: Path, layout: Layout) -> _Counts:
    found = _Counts(layout)
    if not _WIDE.match(layout.encoding.lower()) and layout.delimiter != " " and layout.delimiter.isascii():
        for lines, counts in _plain(path, layout):
            if counts is None:
                break  # quotes, behind which a delimiter or an end of line is part of a field
            found.add(lines, counts)
        else:
            return found
    found = _Counts(layout)
    with path.open(encoding=layout.encoding, errors="replace", newline="") as stream:
        rows = numbered_rows(itertools.islice(stream, layout.begins, None), layout.delimiter)
        while some := list(itertools.islice(rows, 100_000)):
            found.add(np.array([n for n, _ in some]) + layout.begins, np.array([len(row) for _, row in some]))
    return found


def _plain(path: Path, layout: Layout) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
    """Yield line numbers and fields of the rows without parsing each; None for fields that need parsing."""
    begun, rest = 0, b""
    with path.open("rb") as stream:
        while chunk := stream.read(_CHUNK):
            *whole, rest = (rest + chunk).rpartition(b"\n")
            block = b"".join(whole)
            lines, counts = _of_block(block, layout, begun)
            yield lines, counts
            if counts is None:
                return
            begun += block.count(b"\n")
    if rest:
        yield _of_block(rest + b"\n", layout, begun)


def _of_block(block: bytes, layout: Layout, begun: int) -> tuple[np.ndarray, np.ndarray | None]:
    if b'"' in block or b"\r" in block.replace(b"\r\n", b""):
        return np.zeros(0, dtype=int), None
    text = np.frombuffer(block, dtype=np.uint8)
    ends = np.flatnonzero(text == ord("\n"))
    counts = np.bincount(np.searchsorted(ends, np.flatnonzero(text == ord(layout.delimiter))), minlength=len(ends)) + 1
    lines = np.arange(begun + 1, begun + len(ends) + 1)
    keep = lines > layout.begins
    bounds = np.concatenate([[-1], ends])
    for at in np.flatnonzero(counts == 1):
        keep[at] &= bool(block[bounds[at] + 1 : bounds[at + 1]].strip())
    return lines[keep], counts[keep]


def _text_of(path: Path, layout: Layout, line: int) -> str:
    with path.open(encoding=layout.encoding, errors="replace", newline="") as stream:
        return next(itertools.islice(stream, line - 1, None), "").rstrip("\r\n")[:_SHOWN]

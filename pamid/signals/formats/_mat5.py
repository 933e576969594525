"""The table of contents of a MATLAB 5 file, read from its headers alone.

`scipy.io.whosmat` fails on files that hold MATLAB objects, and reading a variable to learn its size is too late.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import BinaryIO, NamedTuple

from pamid.errors import TruncatedLogError

_COMPRESSED, _MATRIX = 15, 14
_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function", 17: "opaque"}
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800


class Variable(NamedTuple):
    """One variable of a file.

    Parameters
    ----------
    name : str
        Its name.
    kind : str
        ``"number"``, or the MATLAB class of what is no plain real array (``"struct"``, ``"cell"``, ``"opaque"``, ...).
    shape : tuple of int
        Declared shape; empty where the class has none.
    stored : int
        Bytes that it takes in the file.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    stored: int


def contents(path: Path) -> list[Variable]:
    """List the variables of a MATLAB 5 file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    list of Variable
        In the order of the file.

    Raises
    ------
    TruncatedLogError
        If an element reaches beyond the end of the file, or its header makes no sense.
    """
    size = path.stat().st_size
    found = []
    with path.open("rb") as stream:
        header = stream.read(128)
        if len(header) < 128:
            raise _damaged(path, "its header is cut off")
        order = "<" if header[126:128] == b"IM" else ">"
        while (start := stream.tell()) < size:
            tag = stream.read(8)
            if len(tag) < 8:
                raise _damaged(path, "it ends inside a variable")
            kind, length = struct.unpack(order + "II", tag)
            if kind not in (_COMPRESSED, _MATRIX) or start + 8 + length > size:
                raise _damaged(path, f"the variable at byte {start} reaches beyond its end")
            found.append(_variable(stream, kind, length, order, path))
            stream.seek(start + 8 + length)
    return found


def _variable(stream: BinaryIO, kind: int, length: int, order: str, path: Path) -> Variable:
    head = stream.read(min(length, 4096))
    if kind == _COMPRESSED:
        try:
            head = zlib.decompressobj().decompress(head, 4096)[8:]
        except zlib.error as error:
            raise _damaged(path, str(error)) from None
    try:
        flags = struct.unpack_from(order + "I", head, 8)[0]
        mx_class = flags & 0xFF
        at = 16
        shape: tuple[int, ...] = ()
        if mx_class != 17:
            body, at = _element(head, at, order)
            shape = struct.unpack(f"{order}{len(body) // 4}i", body)
        body, at = _element(head, at, order)
    except (struct.error, IndexError):
        raise _damaged(path, "a variable's header makes no sense") from None
    name = body.decode("latin-1")
    numeric = mx_class in _NUMERIC and not flags & _COMPLEX
    return Variable(name, "number" if numeric else _CLASSES.get(mx_class, "complex"), shape, length)


def _element(head: bytes, at: int, order: str) -> tuple[bytes, int]:
    """Return the content of the data element at a position, and where the next one begins."""
    first, second = struct.unpack_from(order + "II", head, at)
    if first >> 16:  # small element: type and length in one word, up to four bytes of data in the next
        return head[at + 4 : at + 4 + (first >> 16)], at + 8
    body = head[at + 8 : at + 8 + second]
    if len(body) < second:
        raise IndexError(second)
    return body, at + 8 + (second + 7) // 8 * 8


def _damaged(path: Path, what: str) -> TruncatedLogError:
    return TruncatedLogError(
        f"{path.name} is damaged or cut off: {what}.", "a whole MATLAB file", "Save or copy the log again."
    )

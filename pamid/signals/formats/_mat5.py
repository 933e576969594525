"""MATLAB 5 files: their table of contents, their plain numbers and texts, and nothing else.

`scipy.io` reads these files too, but it fails to list those that hold MATLAB objects, and a damaged or hostile file can
end the whole process there (a segmentation fault in ``read_var_array`` of scipy 1.17). Every length is checked here.
"""

import math
import struct
import zlib
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from pamid.errors import HostileLogError, LogFormatError, TruncatedLogError

_COMPRESSED, _MATRIX = 15, 14
_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function", 17: "opaque"}
_CELL, _CHAR, _OPAQUE = 1, 4, 17
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_UINT16 = 4
_ENCODINGS = {1: "latin-1", 2: "latin-1", 16: "utf-8"}
_HEAD = 4096


class Variable(NamedTuple):
    """One variable of a file."""

    name: str
    kind: str
    shape: tuple[int, ...]
    start: int
    stored: int
    packed: bool


class _Head(NamedTuple):
    mx_class: int
    is_complex: bool
    shape: tuple[int, ...]
    name: str
    end: int


def contents(path: Path) -> list[Variable]:
    """List the variables of a MATLAB 5 file."""
    size = path.stat().st_size
    found = []
    with path.open("rb") as stream:
        order = _byte_order(stream, path)
        while (start := stream.tell()) < size:
            tag = stream.read(8)
            if len(tag) < 8:
                raise _damaged(path, "it ends inside a variable")
            kind, length = struct.unpack(order + "II", tag)
            if kind not in (_COMPRESSED, _MATRIX) or start + 8 + length > size:
                raise _damaged(path, f"the variable at byte {start} reaches beyond its end")
            body = stream.read(min(length, _HEAD))
            if kind == _COMPRESSED:
                body = _unpack(body, _HEAD, path)[8:]
            head = _head(body, order, path)
            numeric = head.mx_class in _NUMERIC and not head.is_complex
            label = "number" if numeric else _CLASSES.get(head.mx_class, "complex")
            found.append(Variable(head.name, label, head.shape, start, length, kind == _COMPRESSED))
            stream.seek(start + 8 + length)
    return found


def load(path: Path, variable: Variable, max_bytes: int, refused: list[str] | None = None) -> Any:
    """Read one variable."""
    with path.open("rb") as stream:
        order = _byte_order(stream, path)
        stream.seek(variable.start + 8)
        body = stream.read(variable.stored)
    if variable.packed:
        body = _unpack(body, max_bytes + 1, path)[8:]
        if len(body) > max_bytes:
            raise HostileLogError(
                f"The variable '{variable.name}' of {path.name} decompresses to more than {max_bytes / 2**30:.3g} GiB.",
                "less",
                "Split the log, or raise max_bytes if the file can be trusted.",
            )
    if variable.kind == "struct":
        return _struct(body, order, path, variable.name, [] if refused is None else refused)
    if variable.kind in ("char", "cell"):
        return _texts(body, order, path)
    return _array(body, order, path)


def _byte_order(stream: BinaryIO, path: Path) -> str:
    header = stream.read(128)
    if len(header) < 128:
        raise _damaged(path, "its header is cut off")
    return "<" if header[126:128] == b"IM" else ">"


def _unpack(data: bytes, limit: int, path: Path) -> bytes:
    try:
        return zlib.decompressobj().decompress(data, limit)
    except zlib.error as error:
        raise _damaged(path, str(error)) from None


def _head(body: bytes, order: str, path: Path) -> _Head:
    try:
        flags = struct.unpack_from(order + "I", body, 8)[0]
        at = 16
        shape: tuple[int, ...] = ()
        if flags & 0xFF != _OPAQUE:
            _, data, at = _element(body, at, order)
            shape = struct.unpack(f"{order}{len(data) // 4}i", data)
        _, data, at = _element(body, at, order)
    except (struct.error, IndexError):
        raise _damaged(path, "a variable's header is invalid") from None
    if any(n < 0 for n in shape):
        raise _damaged(path, "a variable has a negative length")
    return _Head(flags & 0xFF, bool(flags & _COMPLEX), shape, data.decode("latin-1"), at)


def _element(body: bytes, at: int, order: str) -> tuple[int, bytes, int]:
    """Return type and content of the data element at a position, and the start of the next one."""
    first, second = struct.unpack_from(order + "II", body, at)
    if first >> 16:  # small element: type and length in one word, up to four bytes of data in the next
        if first >> 16 > 4:
            raise IndexError(at)
        return first & 0xFFFF, body[at + 4 : at + 4 + (first >> 16)], at + 8
    data = body[at + 8 : at + 8 + second]
    if len(data) < second:
        raise IndexError(second)
    return first, data, at + 8 + (second if first == _COMPRESSED else (second + 7) // 8 * 8)


def _array(body: bytes, order: str, path: Path) -> np.ndarray:
    head = _head(body, order, path)
    count = math.prod(head.shape)
    if count == 0:
        return np.zeros(head.shape)
    try:
        kind, data, _ = _element(body, head.end, order)
        values = np.frombuffer(data, dtype=order + _TYPES[kind])
    except (struct.error, IndexError, KeyError, ValueError):
        raise _damaged(path, f"the numbers of '{head.name}' are incomplete") from None
    if len(values) != count:
        raise _damaged(path, f"'{head.name}' declares {count} numbers and holds {len(values)}")
    return values.astype(values.dtype.newbyteorder("=")).reshape(head.shape, order="F")


def _texts(body: bytes, order: str, path: Path) -> np.ndarray:
    """Return the rows of a character array without padding, or the entries of a cell of texts."""
    head = _head(body, order, path)
    if head.mx_class == _CHAR:
        return np.array([row.rstrip() for row in _characters(body, head, order, path)], dtype=object)
    texts: list[str | None] = []
    at = head.end
    try:
        for _ in range(math.prod(head.shape)):
            _, inner, at = _element(body, at, order)
            own = _head(inner, order, path)
            row = _characters(inner, own, order, path) if own.mx_class == _CHAR else []
            texts.append(row[0] if len(row) == 1 else None)
    except (struct.error, IndexError):
        raise _damaged(path, f"the cell '{head.name}' is incomplete") from None
    return np.array(texts, dtype=object)


def _characters(body: bytes, head: _Head, order: str, path: Path) -> list[str]:
    """Return the rows of a character array, which is stored column by column."""
    rows = math.prod(head.shape[:-1])
    if not rows or not head.shape[-1]:
        return []
    try:
        kind, data, _ = _element(body, head.end, order)
        wide = kind == _UINT16  # units of UTF-16, of which a character may take two
        units = np.frombuffer(data, order + "u2") if wide else np.array(list(data.decode(_ENCODINGS[kind])))
    except (struct.error, IndexError, KeyError, ValueError):
        raise _damaged(path, f"the text of '{head.name}' is incomplete") from None
    if len(units) != rows * head.shape[-1]:
        raise _damaged(path, f"'{head.name}' declares {rows * head.shape[-1]} characters and holds {len(units)}")
    if wide:
        return [units[k::rows].astype("<u2").tobytes().decode("utf-16-le", errors="replace") for k in range(rows)]
    return ["".join(units[k::rows]) for k in range(rows)]


def _struct(body: bytes, order: str, path: Path, name: str, refused: list[str]) -> dict[str, np.ndarray]:
    head = _head(body, order, path)
    if math.prod(head.shape) != 1:
        raise LogFormatError(
            f"The variable '{name}' of {path.name} is a struct array of {'x'.join(map(str, head.shape))}.",
            "one struct of numeric vectors",
            "Save one struct per run.",
        )
    fields: dict[str, np.ndarray] = {}
    try:
        _, data, at = _element(body, head.end, order)
        width = struct.unpack(order + "i", data)[0]
        _, data, at = _element(body, at, order)
        if width <= 0:
            raise IndexError(width)
        for start in range(0, len(data), width):
            key = data[start : start + width].split(b"\0", 1)[0].decode("latin-1")
            kind, inner, at = _element(body, at, order)
            if kind == _MATRIX and inner:
                own = _head(inner, order, path)
                if own.mx_class in _NUMERIC and not own.is_complex:
                    fields[key] = _array(inner, order, path)
                elif own.mx_class in _NUMERIC:
                    refused.append(f"{name}.{key}")
                elif own.mx_class in (_CELL, _CHAR) and math.prod(own.shape) > 1:
                    fields[key] = _texts(inner, order, path)
    except (struct.error, IndexError):
        raise _damaged(path, f"the struct '{name}' is incomplete") from None
    return fields


def _damaged(path: Path, what: str) -> TruncatedLogError:
    return TruncatedLogError(
        f"{path.name} is damaged or cut off: {what}.", "a complete MATLAB file", "Save or copy the log again."
    )

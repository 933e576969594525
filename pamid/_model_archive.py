"""The zip archive of a model file, read with every reason to distrust it.

Nothing here builds an object: entries are bytes, the schema is plain JSON, arrays are judged by their headers.
"""

import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from .errors import HostileModelError, ModelFileError, ModelNotFoundError, TruncatedModelError

SCHEMA = "schema.json"
METADATA = "pamid.json"
MAX_BYTES = 2**29
"""Most memory, in bytes, that loading a model file may take, unless the caller allows more."""
COPIES = 4
"""Copies of the contents that exist at once while a file is loaded: packed, unpacked, handed over, and built."""
MAX_ENTRIES = 20_000
MAX_JSON_BYTES = {SCHEMA: 2**25, METADATA: 2**20}
_OBJECT_BYTES = 100
"""Bytes that the smallest object takes once it is parsed, its place in a container included."""
_PIECE = 1 << 16

_ENTRY = re.compile(r"[A-Za-z0-9_-]{1,100}\.(npy|bin|json)")
_REMEDY = "Do not load this file; ask its author for one written by pamid.persistence.save."


def hostile(found: str, expected: str) -> HostileModelError:
    """Word the refusal of a file that asks for what loading never does."""
    return HostileModelError(found, expected, _REMEDY)


def json_cost(data: bytes) -> int:
    """Return how many bytes of memory JSON takes once it is parsed, at most, without parsing it."""
    # Brackets and commas part objects; within text a comma may also be spelt by its number.
    return len(data) + _OBJECT_BYTES * sum(data.count(mark) for mark in (b",", b"[", b"{", b"u002"))


def read_archive(path: Path, max_bytes: int = MAX_BYTES) -> dict[str, bytes]:
    """Read all entries of a model file into memory, each checked against what it declares."""
    if path.is_dir():
        raise ModelNotFoundError(f"{path} is a folder.", "a model file", "Name the file inside it.")
    try:
        if not path.is_file() and path.exists():  # a pipe or a device may never end
            raise hostile(f"{path} is a device or a pipe.", "a file")
        size, most = path.stat().st_size, max_bytes // COPIES
        if size > most:
            raise hostile(f"{path} is {size} bytes large.", f"at most {most} bytes, or a larger max_bytes")
        data = path.read_bytes()
    except FileNotFoundError:
        raise ModelNotFoundError(f"There is no file {path}.", "a saved model", "Check the path.") from None
    except OSError as error:
        raise ModelFileError(
            f"{path} cannot be read: {error.strerror or error}.", "a readable file", "Check the path and its rights."
        ) from None
    return unpack(data, str(path), max_bytes)


def unpack(data: bytes, name: str, max_bytes: int = MAX_BYTES) -> dict[str, bytes]:
    """Return the entries of a zip archive given as bytes; `read_archive` without the file."""
    if not data.startswith(b"PK\x03\x04"):
        what = "is empty" if not data else f"is no model file: it starts with {data[:8]!r}"
        raise TruncatedModelError(
            f"{name} {what}.", "a file written by 'pamid fit' or pamid.save", "Check that this is the right file."
        )
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = archive.infolist()
            _check_entries(infos, name, max_bytes)
            return {info.filename: _read(archive, info, name) for info in infos}
    except (zipfile.BadZipFile, EOFError, ValueError, OSError, NotImplementedError, RuntimeError) as error:
        if isinstance(error, ModelFileError):
            raise
        raise TruncatedModelError(
            f"{name} is damaged or cut off: {str(error)[:160]}.", "a whole model file", "Copy or save it again."
        ) from None
    except Exception as error:  # zlib.error derives from Exception alone
        if type(error).__module__ != "zlib":
            raise
        raise TruncatedModelError(
            f"{name} is damaged: {error}.", "a whole model file", "Copy or save it again."
        ) from None


def _read(archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str) -> bytes:
    """Read an entry piece by piece: what it unpacks to is no more than it declares."""
    content = bytearray()
    with archive.open(info) as stream:
        # The reader itself stops at the size that is declared, having unpacked no more than a piece beyond it.
        while piece := stream.read(_PIECE):
            content += piece
    if len(content) != info.file_size:
        raise hostile(f"{info.filename!r} in {name} declares {info.file_size} bytes and has {len(content)}.", "as many")
    return bytes(content)


def _check_entries(infos: list[zipfile.ZipInfo], name: str, max_bytes: int) -> None:
    max_bytes //= COPIES
    if len(infos) > MAX_ENTRIES:
        raise hostile(f"{name} holds {len(infos)} entries.", f"at most {MAX_ENTRIES}")
    seen: set[str] = set()
    for info in infos:
        if not _ENTRY.fullmatch(info.filename) or info.filename != info.orig_filename:
            raise hostile(
                f"{name} holds an entry named {info.orig_filename[:80]!r}.", "plain names of .npy, .bin and .json files"
            )
        if info.filename in seen:
            raise hostile(f"{name} holds the entry {info.filename!r} twice.", "each entry once")
        seen.add(info.filename)
        if info.flag_bits & 0x1:
            raise hostile(f"{name} holds an encrypted entry {info.filename!r}.", "no encryption")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise hostile(
                f"{name} packs {info.filename!r} by method {info.compress_type}.", "stored or deflated entries"
            )
        limit = MAX_JSON_BYTES.get(info.filename, max_bytes)
        if info.file_size > limit:
            raise hostile(f"{name} declares {info.file_size} bytes for {info.filename!r}.", f"at most {limit} bytes")
    if (total := sum(info.file_size for info in infos)) > max_bytes:
        raise hostile(f"{name} unpacks to {total} bytes.", f"at most {max_bytes} bytes")


def parse_json(data: bytes, entry: str, name: str, max_bytes: int = MAX_BYTES) -> dict[str, Any]:
    """Parse a JSON entry strictly: UTF-8, an object at the top, no key twice, no endless nesting."""

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) != len(pairs):
            raise hostile(f"{entry} in {name} gives a key twice.", "each key once")
        return found

    if json_cost(data) > max_bytes:
        raise hostile(f"{entry} in {name} describes more objects than fit into {max_bytes} bytes.", "a small model")
    try:
        parsed = json.loads(data.decode("utf-8"), object_pairs_hook=once)
    except UnicodeDecodeError as error:
        raise TruncatedModelError(
            f"{entry} in {name} is not UTF-8 (byte {error.start}).", "JSON in UTF-8", "Copy or save the model again."
        ) from None
    except RecursionError:
        raise hostile(f"{entry} in {name} is nested without end.", "a few hundred levels at most") from None
    except ValueError as error:
        if isinstance(error, ModelFileError):
            raise
        raise TruncatedModelError(
            f"{entry} in {name} is not valid JSON: {error}.", "valid JSON", "Copy or save the model again."
        ) from None
    if not isinstance(parsed, dict):
        raise TruncatedModelError(
            f"{entry} in {name} holds a {type(parsed).__name__}.", "a JSON object", "Copy or save the model again."
        )
    return parsed


def check_arrays(entries: dict[str, bytes], name: str) -> None:
    """Judge every .npy entry by its header: no pickled objects, and exactly as many bytes as its shape needs."""
    for entry, data in entries.items():
        if not entry.endswith(".npy"):
            continue
        stream = io.BytesIO(data)
        try:
            version = np.lib.format.read_magic(stream)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(stream)
        except Exception as error:  # whatever a header's parser raises on bytes made to break it
            raise TruncatedModelError(
                f"The array {entry!r} in {name} has no readable header: {str(error)[:120]}.",
                "an array as numpy.save writes it",
                "Copy or save the model again.",
            ) from None
        if dtype.hasobject:
            raise hostile(f"The array {entry!r} in {name} holds pickled Python objects.", "numbers, booleans or text")
        if any(n < 0 for n in shape):
            raise hostile(f"The array {entry!r} in {name} has the shape {shape}.", "no negative size")
        count = 1
        for n in shape:
            count *= n
        if count * dtype.itemsize != len(data) - stream.tell():
            raise hostile(
                f"The array {entry!r} in {name} claims {count} items of {dtype.itemsize} bytes but brings "
                f"{len(data) - stream.tell()} bytes.",
                "as many bytes as its shape needs",
            )

"""JSON logs: an object with a list of entries and scalars, a bare list of entries, or columns."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pandas as pd

from pamid.errors import DuplicateColumnError, HostileLogError, LogFormatError, MissingColumnError, TruncatedLogError

from ..mapping import LogMapping
from . import Format, RawTable
from ._lists import unfolded


def read(path: Path, mapping: LogMapping, max_bytes: int) -> tuple[list[RawTable], pd.DataFrame | None]:
    """Read a JSON file as one table and its scalars."""
    if path.stat().st_size * 10 > max_bytes:
        raise HostileLogError(
            f"{path.name} has {path.stat().st_size / 2**20:.0f} MiB of JSON.",
            f"at most {max_bytes / 10 / 2**20:.0f} MiB",
            "Convert it to parquet, or raise max_bytes.",
        )
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_of_pairs, parse_int=_of_digits)
    except DuplicateColumnError as error:
        raise DuplicateColumnError(f"{path.name}: {error.found}", error.expected, error.remedy) from None
    except (ValueError, RecursionError) as error:  # a ValueError also of numbers of thousands of digits
        raise TruncatedLogError(
            f"{path.name} is not complete JSON: {error}.", "a complete JSON file", "Export or copy the log again."
        ) from None
    head: dict[str, Any] = {}
    entries: Any = document
    if isinstance(document, dict):
        head = {k: v for k, v in document.items() if isinstance(v, str | int | float) and not isinstance(v, bool)}
        entries = _entries(document, mapping.entries, path)
    if not isinstance(entries, list | dict):
        raise LogFormatError(
            f"{path.name} holds no list of entries.", "a list of objects, one per sample", "Set entries in the mapping."
        )
    if isinstance(entries, list) and not all(isinstance(e, dict) for e in entries):
        if all(isinstance(e, list) for e in entries):
            return [RawTable(_frame(entries, path), named=False, head=head)], None
        raise LogFormatError(
            f"{path.name}: the entries are not all objects.", "a list of objects, one per sample", "Correct the file."
        )
    frame = unfolded(_frame(entries, path))
    nested = [c for c in frame.columns if frame[c].map(lambda v: isinstance(v, list | dict)).any()]
    lost = (f"{', '.join(repr(str(c)) for c in nested[:4])} left out (objects, or lists of several lengths)",)
    return [RawTable(frame.drop(columns=nested), head=head, lost=lost if nested else ())], None


def _of_digits(text: str) -> int | float:
    """Return a whole number; one of more digits than 64 bits hold is a float, which may be infinite."""
    return int(text) if len(text) < 20 else float(text)


def _of_pairs(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object without duplicate keys: a later one would replace the earlier."""
    found = dict(pairs)
    if len(found) < len(pairs):
        counted = Counter(k for k, _ in pairs)
        twice = counted.most_common(1)[0][0]
        raise DuplicateColumnError(f"an object has the key {twice[:60]!r} twice.", "each key once", "Rename one.")
    return found


def _frame(entries: Any, path: Path) -> pd.DataFrame:
    try:
        return pd.DataFrame(entries)
    except (ValueError, TypeError, OverflowError) as error:
        raise LogFormatError(
            f"The entries of {path.name} do not form a table: {' '.join(str(error).split())[:160]}.",
            "the same keys in each entry, with numbers or text",
            "Correct the file.",
        ) from None


def _entries(document: dict[str, Any], key: str | None, path: Path) -> Any:
    if key is not None:
        if key not in document:
            raise MissingColumnError(
                f"{path.name} has no key '{key}'; it has {', '.join(map(str, list(document)[:12]))}.",
                "the list of entries under that key",
                "Correct entries in the mapping.",
            )
        return document[key]
    lists = {k: v for k, v in document.items() if isinstance(v, list)}
    of_objects = [v for v in lists.values() if v and isinstance(v[0], dict)]
    if len(of_objects) == 1:
        return of_objects[0]
    if lists and not of_objects and len({len(v) for v in lists.values()}) == 1:
        return lists
    raise LogFormatError(
        f"{path.name} has {len(of_objects)} lists of objects and the keys {', '.join(map(str, list(document)[:12]))}.",
        "one list of entries, or columns of equal length",
        "Name the list with entries in the mapping.",
    )


def _recognises(head: bytes) -> bool:
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1]
    return start in (b"{", b"[") and b"\x00" not in head[:1024]


FORMAT = Format("JSON", (".json",), _recognises, read, order=5)

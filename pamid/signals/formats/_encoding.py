"""The encoding of a text table: what it says, or what its first bytes show where they show it safely."""

from __future__ import annotations

import re
from pathlib import Path

_HEAD = 65_536
_RUNS = re.compile(rb"[A-Za-z]?[\x80-\xff]+[A-Za-z]?")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")


def is_encoding(name: str) -> bool:
    """Return whether Python knows an encoding of text by a name."""
    try:
        "".encode(name)
    except LookupError:
        return False
    return True


def encoding_of(path: Path) -> str:
    """Tell the encoding of a text file by its first bytes; Latin-1 where nothing else fits."""
    with path.open("rb") as stream:
        return encoding_by(stream.read(_HEAD)) or "latin-1"


def encoding_by(head: bytes) -> str:
    """Return the encoding that the first bytes of a file show; empty where they are no text.

    UTF-8 and UTF-16 show themselves. Chinese text has its letters beyond ASCII in pairs of bytes that stand apart from
    Latin letters; where they do not, the bytes are Latin-1, whose letters are single.
    """
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if wide := _wide(head):
        return wide
    if b"\x00" in head:
        return ""
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:
            if _CONTROL.search(head):
                return ""
            return "gb18030" if _in_pairs(head) else "latin-1"
    return "utf-8-sig"


def _wide(head: bytes) -> str:
    """Return which UTF-16 without a mark it is: every other byte of digits and delimiters is zero."""
    even, odd = head[0::2].count(0), head[1::2].count(0)
    most, name = (odd, "utf-16-le") if odd > even else (even, "utf-16-be")
    if min(even, odd) or most < 0.25 * len(head) // 2:
        return ""
    try:
        text = head[: len(head) // 2 * 2].decode(name)
    except UnicodeDecodeError as error:
        return name if error.start >= len(head) - 4 else ""
    return name if "\n" in text and not _CONTROL.search(text.encode("utf-8")) else ""


def _in_pairs(head: bytes) -> bool:
    runs = _RUNS.findall(head)[:-1] or _RUNS.findall(head)
    alone = [run for run in runs if run[:1].isalpha() or run[-1:].isalpha()]
    try:
        head.decode("gb18030")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:
            return False
    bare = [re.sub(rb"[A-Za-z]", b"", run) for run in runs]
    return all(len(run) % 2 == 0 for run in bare) and len(alone) < 0.5 * len(runs)

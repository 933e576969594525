"""The encoding of a text table: as stated, or as its first bytes show it reliably."""

import re
from pathlib import Path

_HEAD = 65_536
_USUAL = frozenset("äöüßÄÖÜéèêàçáíóúñåøæ°µ²³".encode("latin-1"))
_BORDER = -1.6
"""The same of a Latin letter beside a Chinese one; in Western text it is usual."""
_BESIDE = -3.0
"""Logarithm of about how often one letter beyond ASCII follows another in Western text."""
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")


def is_encoding(name: str) -> bool:
    """Return whether Python knows an encoding of text by a name."""
    try:
        "".encode(name)
    except LookupError:
        return False
    return True


def encoding_of(path: Path) -> str:
    """Recognise the encoding of a text file by its first bytes; Latin-1 if nothing else fits."""
    with path.open("rb") as stream:
        return encoding_by(stream.read(_HEAD)) or "latin-1"


def encoding_by(head: bytes) -> str:
    """Return the encoding that the first bytes of a file show; empty where they are no text."""
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
            return "gb18030" if _is_chinese(head) else "latin-1"
    return "utf-8-sig"


def _wide(head: bytes) -> str:
    """Return the byte order of UTF-16 without a mark: every other byte of digits and delimiters is zero."""
    even, odd = head[0::2].count(0), head[1::2].count(0)
    most, name = (odd, "utf-16-le") if odd > even else (even, "utf-16-be")
    if min(even, odd) or most < 0.25 * len(head) // 2:
        return ""
    try:
        text = head[: len(head) // 2 * 2].decode(name)
    except UnicodeDecodeError as error:
        return name if error.start >= len(head) - 4 else ""
    return name if "\n" in text and not _CONTROL.search(text.encode("utf-8")) else ""


def _is_chinese(head: bytes) -> bool:
    """Return whether bytes that are no UTF-8 are likelier as Chinese than as Western text: a likelihood ratio."""
    try:
        text = head.decode("gb18030")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:
            return False
        text = head[: error.start].decode("gb18030")
    ratio, before = 0.0, ""
    for c in text:
        pair = c.encode("gb18030")
        if len(pair) > 1:
            ratio += _of_chinese(pair) - sum(_of_western(b) for b in pair)
            ratio -= _BESIDE * (sum(b > 0x7F for b in pair) - 1 + (not before.isascii()))
        if before and before.isascii() != c.isascii() and (before if before.isascii() else c).isalpha():
            ratio += _BORDER
        before = c
    return ratio > 0.0


def _of_chinese(pair: bytes) -> float:
    """Return the logarithm of about how often Chinese text has a character."""
    if len(pair) > 2:
        return -14.0
    common = 0xB0 <= pair[0] <= 0xD7 and pair[1] > 0xA0  # the 3,755 that GB 2312 has first
    return -7.3 if common or (pair[0] < 0xAA and pair[1] > 0xA0 and pair[0] > 0xA0) else -9.0


def _of_western(byte: int) -> float:
    """Return the same of a byte beyond ASCII, or a letter, in Western text."""
    if byte < 0x80:
        return -3.0
    return -3.2 if byte in _USUAL else -5.5 if byte > 0xBF else -7.0 if byte > 0x9F else -12.0

"""Colour, where a person is looking at a terminal that shows it."""

import os
import sys
from typing import TextIO

_CODES = {"error": "31", "warning": "33", "yes": "32", "partly": "33", "no": "31", "head": "1", "page": "36"}


def coloured(stream: TextIO | None = None) -> bool:
    """Return whether colours may be written: to a terminal that is not dumb, unless ``NO_COLOR`` is set."""
    stream = stream or sys.stdout
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):
        return False


def plain(text: str) -> str:
    """Return a text without control characters: a log must not steer a terminal."""
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def marked(text: str, kind: str, stream: TextIO | None = None) -> str:
    """Return a text in the colour of its kind, where colours may be written."""
    return f"\x1b[{_CODES[kind]}m{text}\x1b[0m" if coloured(stream) else text

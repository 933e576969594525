"""Colour, where a person is looking at a terminal that shows it."""

from __future__ import annotations

import os
import sys
from typing import TextIO

_CODES = {
    "error": "31",
    "warning": "33",
    "yes": "32",
    "partly": "33",
    "no": "31",
    "head": "1",
    "page": "36",
}


def coloured(stream: TextIO | None = None) -> bool:
    """Say whether colours may be written: to a terminal that is not dumb, unless ``NO_COLOR`` is set.

    Parameters
    ----------
    stream : file, optional
        Where to; standard output by default.

    Returns
    -------
    bool
        Whether colours may be written.
    """
    stream = stream or sys.stdout
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):
        return False


def plain(text: str) -> str:
    """Return a text without control characters: what a log says must not steer a terminal.

    Parameters
    ----------
    text : str
        The text.

    Returns
    -------
    str
        The text with a blank for each; line ends stay.
    """
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def marked(text: str, kind: str, stream: TextIO | None = None) -> str:
    """Return a text in the colour of its kind, where colours may be written.

    Parameters
    ----------
    text : str
        The text.
    kind : str
        ``"error"``, ``"warning"``, ``"yes"``, ``"partly"``, ``"no"``, ``"head"``, ``"page"``.
    stream : file, optional
        Where to; standard output by default.

    Returns
    -------
    str
        The text, between the codes of its colour or as it is.
    """
    return f"\x1b[{_CODES[kind]}m{text}\x1b[0m" if coloured(stream) else text

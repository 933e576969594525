"""Pictures left out where a test does not look at them: drawing takes most of a small diagnosis."""

from __future__ import annotations

from functools import wraps
from html import escape
from pathlib import Path
from typing import BinaryIO

import pytest
from matplotlib.figure import Figure

from pamid.report import svg


def leave_out(patch: pytest.MonkeyPatch) -> None:
    """Have reports hold empty pictures, and figures write their numbers."""
    patch.setattr(svg, "inline_svg", wraps(svg.inline_svg)(_empty))
    patch.setattr(Figure, "savefig", _numbers)


def _empty(figure: object, name: str, words: str) -> str:
    return f'<svg viewBox="0 0 1 1" role="img" aria-label="{escape(words)}"></svg>'


def _numbers(figure: Figure, file: BinaryIO | str, **_: object) -> None:
    """Write what a figure shows, so that other data are another file."""
    numbers = []
    for axes in figure.axes:
        drawn = [line.get_path() for line in axes.lines]
        drawn += [path for collection in axes.collections for path in collection.get_paths()]
        numbers += [path.vertices.tolist() for path in drawn]
    if isinstance(file, str):
        Path(file).write_text(repr(numbers), encoding="utf-8")
    else:
        file.write(repr(numbers).encode())

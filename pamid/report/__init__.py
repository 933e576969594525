"""A diagnosis for people: its sentences, its pictures, and the page that holds both."""

from __future__ import annotations

import importlib
from typing import Any

_HOME = {
    "Answers": "sentences",
    "GapDisplay": "display",
    "answers": "sentences",
    "report_html": "page",
    "write_report": "page",
}
"""In which module each public name lives."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)

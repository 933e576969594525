"""What is in a log: columns, sampling, faults, excitation; what can be identified from it, and what to record next."""

from __future__ import annotations

import importlib
from typing import Any

_HOME = {
    "Survey": "survey",
    "survey": "survey",
    "Channel": "channels",
    "Sampling": "sampling",
    "Coverage": "coverage",
    "Answerable": "answerable",
    "Separation": "separation",
    "survey_html": "page",
}

__all__ = sorted(set(_HOME) - {"survey"})


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

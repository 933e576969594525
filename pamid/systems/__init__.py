"""Systems other than the antagonistic bench whose gap can be diagnosed from a log and a page of numbers.

A module of this package that defines a `System` adds a kind; ``pamid init --kind`` and ``pamid diagnose`` then know it.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import Any

from .base import Input, Quantity, System

_NOT_SYSTEMS = {
    "base",
    "correction",
    "bench_page",
    "diagnosis",
    "draft",
    "file",
    "raw",
    "reference",
    "evaluation",
    "comparison",
}
_HOME = {
    "diagnose_system": "diagnosis",
    "read_system": "file",
    "kind_of_file": "file",
    "system_text": "file",
    "draft_for": "draft",
    "evaluate_system": "evaluation",
    "compare_system": "comparison",
}

__all__ = ["Input", "Quantity", "System", "all_systems", *sorted(_HOME)]


@cache
def all_systems() -> dict[str, type[System]]:
    """Return every kind of system.

    Returns
    -------
    dict of str to class
        Systems by their kind, in alphabetical order.

    Examples
    --------
    >>> from pamid.systems import all_systems
    >>> list(all_systems())
    ['cylinder', 'joint', 'muscle']
    """
    found: dict[str, type[System]] = {}
    for module in pkgutil.iter_modules(__path__):
        if module.name in _NOT_SYSTEMS:
            continue
        for thing in vars(importlib.import_module(f"{__name__}.{module.name}")).values():
            if isinstance(thing, type) and issubclass(thing, System) and thing is not System:
                found[thing.kind] = thing
    return dict(sorted(found.items()))


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""Find the kinds of systems."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from .. import systems as package
from .base import System

_NOT_SYSTEMS = {
    "base",
    "bench_page",
    "comparison",
    "correction",
    "diagnosis",
    "draft",
    "evaluation",
    "file",
    "raw",
    "reference",
    "registry",
}


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
    for module in pkgutil.iter_modules(package.__path__):
        if module.name in _NOT_SYSTEMS:
            continue
        for thing in vars(importlib.import_module(f"{package.__name__}.{module.name}")).values():
            if isinstance(thing, type) and issubclass(thing, System) and thing is not System:
                found[thing.kind] = thing
    return dict(sorted(found.items()))

"""Find the kinds of systems."""

from functools import cache

from .._discovery import subclasses
from .base import System

_NOT_SYSTEMS = {"base", "bench_page", "comparison", "correction", "draft", "file", "raw", "reference", "registry"}


@cache
def all_systems() -> dict[str, type[System]]:
    """Return every kind of system."""
    found = {cls.kind: cls for cls in subclasses("pamid.systems", System, _NOT_SYSTEMS)}
    return dict(sorted(found.items()))

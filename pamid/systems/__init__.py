"""Systems other than the antagonistic bench whose gap can be diagnosed from a log and a simulator file of numbers.

A module of this package that defines a `System` adds a kind; ``pamid init --kind`` and ``pamid diagnose`` then know it.
"""

from __future__ import annotations

from .._lazy import attach, renamed

_HOME = {
    "Input": "base",
    "Quantity": "base",
    "System": "base",
    "all_systems": "registry",
    "read_system": "file",
    "compare_system": "comparison",
}
"""In which module each public name lives."""

_lookup, __dir__, __all__ = attach(__name__, _HOME)
__getattr__ = renamed(__name__, {"diagnose_system": "pamid.diagnose", "evaluate_system": "pamid.evaluate"}, _lookup)

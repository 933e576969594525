"""Systems other than the antagonistic bench whose gap can be diagnosed from a log and a simulator file of numbers.

A module of this package that defines a `System` adds a kind; ``pamid init --kind`` and ``pamid diagnose`` then know it.
"""

from .._lazy import attach, homes, renamed

_HOME = homes(
    base="Input Quantity System",
    registry="all_systems",
    file="read_system",
    comparison="compare_system",
)
"""In which module each public name lives."""

_lookup, __dir__, __all__ = attach(__name__, _HOME)
__getattr__ = renamed(__name__, {"diagnose_system": "pamid.diagnose", "evaluate_system": "pamid.evaluate"}, _lookup)

"""Names of a package that are imported when they are first asked for, so that importing the package stays quick.

Type checkers read the package's ``__init__.pyi``, which ``python docs/tables.py`` writes from the same names.
"""

import importlib
import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def homes(**modules: str) -> dict[str, str]:
    """Return the module of each name, from the names that each module gives."""
    return {name: module for module, names in modules.items() for name in names.split()}


def attach(package: str, home: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Make ``__getattr__``, ``__dir__`` and ``__all__`` of a package (PEP 562)."""

    def lookup(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = importlib.import_module(f"{package}.{home[name]}")
        return module if home[name] == name else getattr(module, name)

    return lookup, lambda: sorted({*home, *vars(sys.modules[package])}), sorted(home)


def renamed(
    package: str, names: Mapping[str, str], otherwise: Callable[[str], Any] | None = None
) -> Callable[[str], Any]:
    """Return a ``__getattr__`` that resolves old names with a warning; a new name with a dot is in another package."""

    def lookup(name: str) -> Any:
        if name in names:
            home, _, new = (names[name] if "." in names[name] else f"{package}.{names[name]}").rpartition(".")
            warnings.warn(
                f"{package}.{name} is called {home}.{new}; the next version knows the new name only.",
                FutureWarning,
                stacklevel=2,
            )
            return getattr(importlib.import_module(home), new)
        if otherwise is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return otherwise(name)

    return lookup

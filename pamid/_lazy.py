"""Names of a package that are imported when they are first asked for, so that importing the package stays quick.

Type checkers read the package's ``__init__.pyi``, which ``python docs/tables.py`` writes from the same names.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def attach(package: str, home: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Make ``__getattr__``, ``__dir__`` and ``__all__`` of a package (PEP 562).

    Parameters
    ----------
    package : str
        ``__name__`` of the package.
    home : mapping of str to str
        Module or subpackage in which each public name is defined; a name that is its own home is that module.

    Returns
    -------
    tuple of (callable, callable, list of str)
        To be assigned to ``__getattr__, __dir__, __all__``.

    Examples
    --------
    >>> from pamid._lazy import attach
    >>> lookup, names, public = attach("pamid", {"PamidError": "errors", "errors": "errors"})
    >>> lookup("PamidError").__name__, public
    ('PamidError', ['PamidError', 'errors'])
    """

    def lookup(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = importlib.import_module(f"{package}.{home[name]}")
        return module if home[name] == name else getattr(module, name)

    return lookup, lambda: sorted({*home, *vars(sys.modules[package])}), sorted(home)

"""Which estimators there are: found in the modules of this folder, so that a new one is one new file and no list.

A module whose name has no leading underscore is public, and so is a class defined in it whose name has none. The
names are read from the source without running it: asking for one estimator imports its module alone.
"""

import ast
import importlib
import importlib.util
import inspect
from functools import cache
from types import ModuleType
from typing import Any

from pamid._discovery import module_names
from pamid.errors import IncompatibleError

_PACKAGE = __package__ or "pamid.estimators"


def public_modules() -> list[str]:
    """Return the names of the public modules of the package, sorted, without importing them."""
    names = (full.rpartition(".")[2] for full in module_names(_PACKAGE))
    return [name for name in names if not name.startswith("_")]


@cache
def class_locations() -> dict[str, str]:
    """Return the public classes of the package: name of the class to name of its module."""
    found: dict[str, str] = {}
    for module in public_modules():
        for name in _class_names(module):
            if name in found:
                raise IncompatibleError(
                    f"The modules {found[name]} and {module} of {_PACKAGE} both define a class {name}.",
                    "every public class name once",
                    "Rename one of them, or begin the name of the helper with an underscore.",
                )
            found[name] = module
    return dict(sorted(found.items()))


def load_class(name: str) -> Any:
    """Import the module that defines a public class, and return the class."""
    return getattr(_module(class_locations()[name]), name)


def all_estimators() -> list[tuple[str, type]]:
    """List every public estimator and transformer of the package."""
    from sklearn.base import BaseEstimator

    classes = ((name, load_class(name)) for name in class_locations())
    return [(name, c) for name, c in classes if issubclass(c, BaseEstimator) and not inspect.isabstract(c)]


def checked_instances() -> list[Any]:
    """Build small, quick instances of every public estimator, on which the common checks run."""
    instances: list[Any] = []
    for name, estimator_class in all_estimators():
        own = list(getattr(estimator_class, "_checked_instances", list)())
        if not own or any(type(e) is not estimator_class for e in own):
            raise IncompatibleError(
                f"{name}._checked_instances() gives {[type(e).__name__ for e in own] or 'nothing'}.",
                f"at least one instance of {name}, and of nothing else",
                f"Give {name} a static or class method _checked_instances() that returns a list of small instances.",
            )
        instances += own
    return instances


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"{_PACKAGE}.{name}")


def _class_names(module: str) -> list[str]:
    """Names of the public classes that a module defines, from its source if that is at hand."""
    spec = importlib.util.find_spec(f"{_PACKAGE}.{module}")
    source = spec.loader.get_source(spec.name) if spec and hasattr(spec.loader, "get_source") else None  # type: ignore[union-attr]
    if source is None:  # installed without sources
        loaded = _module(module)
        names = [n for n, c in inspect.getmembers(loaded, inspect.isclass) if c.__module__ == loaded.__name__]
    else:
        names = [node.name for node in ast.parse(source).body if isinstance(node, ast.ClassDef)]
    return [name for name in names if not name.startswith("_")]

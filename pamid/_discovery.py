"""Find the classes that the modules of a package define, so that something new is one new file."""

import importlib
import inspect
import pkgutil
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, TypeGuard, TypeVar

Kind = TypeVar("Kind")


def module_names(package: str, nested: bool = False) -> list[str]:
    """Return the full names of the modules of a package in alphabetical order; only the package itself is imported."""
    return sorted(_names_below(package, importlib.import_module(package).__path__, nested))


def _names_below(package: str, path: Iterable[str], nested: bool) -> Iterator[str]:
    for found in pkgutil.iter_modules(path):
        yield f"{package}.{found.name}"
        if nested and found.ispkg:
            yield from _names_below(f"{package}.{found.name}", [str(Path(p) / found.name) for p in path], nested)


def modules(package: str, leave_out: Collection[str] = ()) -> list[ModuleType]:
    """Import the modules of a package in alphabetical order, but for those that begin with an underscore."""
    last = {full: full.rpartition(".")[2] for full in module_names(package)}
    return [
        importlib.import_module(full)
        for full, name in last.items()
        if not name.startswith("_") and name not in leave_out
    ]


def subclasses(package: str, base: type[Kind], leave_out: Collection[str] = ()) -> list[type[Kind]]:
    """Return the classes below `base` that the modules of a package define; abstract ones are left out."""
    return [
        thing
        for module in modules(package, leave_out)
        for thing in vars(module).values()
        if _is_below(thing, base) and thing.__module__ == module.__name__
    ]


def _is_below(thing: Any, base: type[Kind]) -> TypeGuard[type[Kind]]:
    """Return whether a thing is a whole class that names a base, which may be a protocol."""
    return inspect.isclass(thing) and base in thing.__mro__[1:] and not inspect.isabstract(thing)

"""Find the classical volume models: every class in this folder's modules that says its name."""

from __future__ import annotations

import importlib
import inspect
import pkgutil

from ..errors import UnknownOptionError
from .classical import ClassicalVolume


def all_volumes() -> dict[str, type[ClassicalVolume]]:
    """Return every classical volume model by its name, in alphabetical order.

    Returns
    -------
    dict of str to type
        Name and class.

    Examples
    --------
    >>> from pamid.volume import all_volumes
    >>> sorted(all_volumes())
    ['bou_saba', 'chou_hannaford', 'cylinder', 'hildebrandt', 'polynomial', 'tondu_lopez']
    """
    package = importlib.import_module(__package__)
    found: dict[str, type[ClassicalVolume]] = {}
    for module in pkgutil.iter_modules(package.__path__):
        if module.name.startswith("_"):
            continue
        for _, cls in inspect.getmembers(importlib.import_module(f"{__package__}.{module.name}"), inspect.isclass):
            if issubclass(cls, ClassicalVolume) and not inspect.isabstract(cls):
                found[cls.name] = cls
    return dict(sorted(found.items()))


def volume_class(name: str) -> type[ClassicalVolume]:
    """Return the classical volume model of this name.

    Parameters
    ----------
    name : str
        Such as ``"chou_hannaford"``.

    Returns
    -------
    type
        The class.

    Raises
    ------
    UnknownOptionError
        If there is no such model.

    Examples
    --------
    >>> from pamid.volume import volume_class
    >>> volume_class("chou_hannaford").__name__
    'BraidedVolume'
    """
    found = all_volumes()
    if name not in found:
        raise UnknownOptionError(
            f"There is no volume model {name!r}.", f"one of {', '.join(found)}", "Correct the name."
        )
    return found[name]

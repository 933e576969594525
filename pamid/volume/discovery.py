"""Find the classical volume models: every class in this folder's modules that says its name."""

from functools import cache

from .._discovery import subclasses
from ..names import require_one_of
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
    return dict(_found())


@cache
def _found() -> dict[str, type[ClassicalVolume]]:
    return dict(sorted((cls.name, cls) for cls in subclasses("pamid.volume", ClassicalVolume)))


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
    require_one_of(name, found, f"There is no volume model {name!r}.")
    return found[name]

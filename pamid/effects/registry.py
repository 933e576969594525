"""Find effects by name."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from .._discovery import modules
from .._plugins import left_out, plugins
from ..errors import UnknownOptionError, among
from .base import Effect

_NOT_EFFECTS = {"base", "plant", "registry"}


def all_effects() -> dict[str, type[Effect]]:
    """Return every effect of the library, of installed plug-ins and every effect that the caller has defined.

    Returns
    -------
    dict of str to class
        Effects by name, in alphabetical order.

    Examples
    --------
    >>> from pamid.effects import all_effects
    >>> all_effects()["leakage"].equations
    ('flow',)
    """
    _load_library()
    return dict(sorted(Effect.registry.items()))


@cache
def _load_library() -> None:
    """Import the modules of this package and of plug-ins once, so that they register themselves."""
    modules("pamid.effects", _NOT_EFFECTS)
    expected = "a class below pamid.effects.Effect with a name of its own"
    for source, thing in plugins("pamid.effects", expected):
        if not (isinstance(thing, type) and issubclass(thing, Effect) and thing in Effect.registry.values()):
            left_out(source, repr(thing), expected)


def chosen_effects(effects: str | Sequence[str], kind: str = "") -> list[str]:
    """Return the effects of a choice: "all" (of a `kind` of system, if given) or names; raise if one is unknown.

    Examples
    --------
    >>> from pamid.effects.registry import chosen_effects
    >>> chosen_effects("leakage")
    ['leakage']
    """
    known = all_effects()
    if isinstance(effects, str) and effects == "all":
        return [name for name, cls in known.items() if not kind or kind in cls.kinds]
    library = [effects] if isinstance(effects, str) else list(effects)
    if strange := [name for name in library if name not in known]:
        raise UnknownOptionError(
            f"The library has no effect {', '.join(map(repr, strange))}.",
            f"names of {', '.join(known)}",
            "Correct the names.",
        )
    return library


def make_effect(name: str, **values: float) -> Effect:
    """Return an effect by its name, with values for its parameters.

    Parameters
    ----------
    name : str
        Name of an effect, such as ``"hysteresis"``.
    **values : float
        Values of its parameters; those left out keep their nominal values.

    Returns
    -------
    Effect
        The effect.

    Raises
    ------
    UnknownOptionError
        There is no effect of that name.
    UnknownParameterError
        The effect has no such parameter.
    ImplausibleParameterError
        A value is outside its physical range.

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("leakage", conductance=2e-10)
    leakage(conductance=2e-10 m^3/(s Pa))
    """
    known = all_effects()
    if name not in known:
        raise UnknownOptionError(
            f"There is no effect {name!r}.", *among(name, known, "Import the module that defines it first.")
        )
    return known[name](**values)

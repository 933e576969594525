"""An effect with its values: from a simulator file to the effect object and back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

from ..errors import (
    MissingParameterError,
    ParameterError,
    SimulatorTypeError,
    UnknownOptionError,
    UnknownParameterError,
)
from ..explained import explained_fields
from .base import Effect
from .registry import all_effects, make_effect
from .values import Parameter


@explained_fields
class EffectSpec(NamedTuple):
    """Name and parameters of an effect.

    Examples
    --------
    >>> from pamid.effects import EffectSpec
    >>> spec = EffectSpec.of(("leakage", {}))
    >>> spec.values, spec.make()
    ({'conductance': 1e-10}, leakage(conductance=1e-10 m^3/(s Pa)))
    >>> print(*spec.lines(), sep=chr(10))
    [[effects]]
    name = "leakage"
    conductance = 1e-10  # m^3/(s Pa)
    """

    name: Annotated[str, "Name of the effect."]
    values: Annotated[dict[str, float], "Its parameters by name."]

    @classmethod
    def of(cls, entry: EffectLike, in_units: bool = False) -> EffectSpec:
        """Return an entry of a simulator file, an effect, or a name with or without parameters, as a checked spec.

        With ``in_units`` its parameters are in the file's own units, so that physical ranges in SI do not apply. What
        is no effect, an unknown name or parameter, and a value out of range raise.
        """
        try:
            made = effect_of(entry, in_units)
        except UnknownOptionError as error:
            raise UnknownParameterError(f"effects: {error.found}", error.expected, error.remedy) from error
        return cls(made.name, dict(made.values))

    def make(self, in_units: bool = False) -> Effect:
        """Return the effect as an object; in units of its own, physical ranges in SI do not apply."""
        return effect_of((self.name, self.values), in_units)

    def lines(self, unit_of: Callable[[type[Effect], Parameter], str] = lambda _, p: p.unit) -> list[str]:
        """Return the lines of a simulator file; units are the library's, or those that `unit_of` gives."""
        kind = all_effects()[self.name]
        units = {p.name: unit_of(kind, p) for p in kind.parameters}
        numbers = [f"{key} = {float(v)!r}  # {units[key]}".removesuffix("  # -") for key, v in self.values.items()]
        return ["[[effects]]", f'name = "{self.name}"', *numbers]


EffectLike = Effect | str | tuple[str, Mapping[str, float]]
"""How an effect may be given: the object, a name with the nominal parameters, or a name with parameters."""


def effect_of(entry: EffectLike, in_units: bool = False) -> Effect:
    """Return an effect from an object, a name or a pair; `in_units`: the parameters are not in SI, so unbounded.

    Examples
    --------
    >>> from pamid.effects.spec import effect_of
    >>> effect_of("viscous_friction").name, effect_of(("leakage", {"conductance": 2e-10}))
    ('viscous_friction', leakage(conductance=2e-10 m^3/(s Pa)))
    """
    if isinstance(entry, Effect):
        return entry
    if isinstance(entry, str):
        return make_effect(entry)
    try:
        name, values = entry
    except (TypeError, ValueError):
        raise SimulatorTypeError(f"An effect is {entry!r}.", "a pair (name, parameters)", "Give both.") from None
    if in_units and name in (known := all_effects()):
        return known[name].in_units(**values)
    return make_effect(name, **values)


def as_effects(effects: Iterable[EffectLike]) -> list[Effect]:
    """Return effects given as objects, names or pairs (name, parameters) as objects.

    Examples
    --------
    >>> from pamid.effects.spec import as_effects
    >>> as_effects(["leakage", ("viscous_friction", {"coefficient": 40.0})])
    [leakage(conductance=1e-10 m^3/(s Pa)), viscous_friction(coefficient=40 N s)]
    """
    if isinstance(effects, (str, Effect)):
        raise ParameterError(f"effects is {effects!r}.", "a sequence of effects", "Put it in a list.")
    return [effect_of(e) for e in effects]


def specs_of(tables: Any) -> Sequence[EffectSpec]:
    """Return the entries under ``[[effects]]`` of a simulator file; `EffectSpec.of` checks them.

    Examples
    --------
    >>> from pamid.effects.spec import specs_of
    >>> specs_of([{"name": "leakage", "conductance": 2e-10}])
    [EffectSpec(name='leakage', values={'conductance': 2e-10})]
    """
    if not isinstance(tables, list) or not all(isinstance(entry, dict) for entry in tables):
        raise SimulatorTypeError(
            f"effects is {str(tables)[:60]}.", "tables", "Write each effect under a line [[effects]] with its name."
        )
    specs = []
    for entry in tables:
        values = dict(entry)
        name = values.pop("name", None)
        if name is None:
            raise MissingParameterError("[[effects]] lacks name.", "the name of an effect", 'Add name = "...".')
        if not isinstance(name, str):
            raise SimulatorTypeError(f"The name of an effect is {name!r}.", "text", "Put it in quotes.")
        specs.append(EffectSpec(name, values))
    return specs

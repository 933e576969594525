"""What a cause is called and how large it is, in the quantity that an engineer would measure."""

import math
import re
from collections.abc import Mapping
from typing import Any

from ..effects import Effect, Parameter, all_effects
from ..gap.diagnosis.findings import Cause, ParameterEstimate
from ..simulators import port_effects
from ..simulators.dimensions import unit_powers
from .quantities import amount, amount_within, effect, listed, parameter, placed, places, said_at, span
from .words import Words

Estimates = Mapping[str, "ParameterEstimate"]

DEVIATION = "parameter_deviation"
DRIFTS = {"parameter_drift": "drift of {}", "parameter_drift_in_runs": "drift of {} in each run"}
_ALIKE = 0.1
"""How much two sizes of one thing may differ, as a share: each is fitted in the place of the other."""
_MODEL = re.compile(r"^(?:body|dof|jnt|actuator)_(\w+)\.(.+)$")


def named(name: str, port: str) -> str:
    """Return a cause's name as words: an effect at its port, or the parameter of the simulator that is wrong."""
    if name == DEVIATION:
        return _parameter(port)
    return DRIFTS[name].format(_parameter(port)) if name in DRIFTS else placed(name, port)


def _parameter(name: str) -> str:
    of_model = _MODEL.match(name)  # MuJoCo's names, dof_damping.hip
    return f"{of_model[1]} of {of_model[2]}" if of_model else f"parameter {name}"


def cause_names(cause: Cause, words: Words) -> list[str]:
    """Return the effects of a cause as words, with the ports at which they act; the same physics only once."""
    return [named(name, port) for name, port, _ in _alternatives(cause, words)]


def either(cause: Cause, words: Words) -> str:
    """Describe a cause in a few words, each place once."""
    at: dict[str, list[str]] = {}
    for name, port, _ in _alternatives(cause, words):
        if name == DEVIATION or name in DRIFTS:
            at[named(name, port)] = []
        else:
            at.setdefault(port, []).append(effect(name))
    return listed([said_at(listed(names, "or"), port) if names else port for port, names in at.items()], "or")


def causes_listed(causes: list[str]) -> str:
    """Return several causes in a row, of which some may be alternatives themselves."""
    return "; ".join(causes) if any(" or " in c or " and " in c for c in causes) else listed(causes)


def _alternatives(cause: Cause, words: Words) -> list[tuple[str, str, Estimates]]:
    """Return names, ports and parameters of a cause's alternatives; a parameter stands for an equivalent effect."""
    sizes = [cause.parameters, *cause.others]
    sizes += [{}] * (len(cause.effects) - len(sizes))
    found: list[tuple[str, str, Estimates]] = list(zip(cause.effects, places(cause), sizes, strict=True))
    wrong = [
        (words.numbers.get(port), p["deviation"]) for name, port, p in found if name == DEVIATION and "deviation" in p
    ]
    deviations = [(n.unit, n.value * p.value) for n, p in wrong if n is not None]
    kept = [one for one in found if one[0] == DEVIATION or not _same(one[2], deviations)]
    return sorted(kept, key=lambda one: one[0] != DEVIATION) if len(kept) < len(found) else found


def _same(sizes: Estimates, deviations: list[tuple[str, float]]) -> bool:
    main = next(iter(sizes.values()), None)
    return main is not None and any(
        _unit(unit) in ({}, _unit(main.unit)) and abs(main.value - change) <= _ALIKE * abs(change)
        for unit, change in deviations
        if _unit(main.unit)
    )


def _unit(unit: str) -> dict[str, int]:
    return {word: power for word, power in unit_powers(unit).items() if word != "rad"}


# --- sizes --------------------------------------------------------------------------------------------------
def size(cause: Cause, words: Words, full: bool = False) -> str:
    """Return the size of a cause's likeliest alternative; `full` explains its interval."""
    name, port, sizes = _alternatives(cause, words)[0]
    told = (
        [_deviation(words.numbers.get(port), sizes["deviation"], full)]
        if name == DEVIATION and "deviation" in sizes
        else []
    )
    kind = _effect(name)
    for word, p in () if told else _telling(kind, sizes):
        unit = shown_unit(name, word, p.unit, port)
        one = f"{parameter(word)} {amount_within(p.value, *p.ci90, unit)}{_interval(p, unit, full)}"
        told.append(f"{one}, which is {p.physical}" if p.physical else one)
    return ", ".join(told)


def _interval(p: ParameterEstimate, unit: str, full: bool) -> str:
    """Return an interval in brackets; its unit is left out where it stands before."""
    ends = [amount(end, unit) for end in p.ci90]
    known = all(math.isfinite(end) for end in p.ci90)
    if not known:
        return f" (90 % interval {span(*p.ci90, unit)})" if full else ""
    tail = ends[0].partition(" ")[2]
    within = span(*p.ci90, unit) if full else span(*p.ci90, unit).removesuffix(f" {tail}")
    bound = ", at its physical limit" if p.at_bound and full else ""
    return f" ({'90 % interval ' if full else ''}{within}{bound})"


def _deviation(own: Any, p: ParameterEstimate, full: bool) -> str:
    """Return a wrong parameter's value, and the simulator's own parameter's."""
    if own is None or not math.isfinite(p.value):
        return f"off by {amount_within(p.value, *p.ci90, '-')}{_interval(p, '-', full)}"
    unit = "" if own.unit == "-" else own.unit
    value, *ends = (own.value * (1.0 + x) for x in (p.value, *p.ci90))
    found = p.scaled(1.0, unit)
    known = type(found)(value, unit, (min(ends), max(ends)), p.at_bound)
    told = f"{amount_within(value, *known.ci90, unit)}{_interval(known, unit, full)}"
    return f"{told}, instead of the simulator's {amount(own.value, unit)}"


def _telling(kind: type[Effect] | None, sizes: Estimates) -> list[tuple[str, ParameterEstimate]]:
    """Return the parameters that say how large a cause is: the first, and others surely nonzero and not at a bound."""
    known = {p.name: p for p in kind.parameters} if kind else {}
    adding = [n for n, q in known.items() if q.linear and n in sizes]
    open_ = [n for n in adding if not _bounded(sizes[n]) and sizes[n].value != 0.0]
    sure = [n for n in adding if n in open_ or (_bounded(sizes[n]) and sizes[n].ci90[0] * sizes[n].ci90[1] > 0.0)]
    main = next(iter(sure or sizes), "")
    found = []
    for place, (name, p) in enumerate(sizes.items()):
        more = _bounded(p) and p.ci90[0] * p.ci90[1] > 0.0 and not p.at_bound
        shapes = name in known and (known[name].refines or known[name].periods)
        if name == main or (more and (place < 2 or name in adding or shapes)):
            found.append((name, p))
    return sorted(found, key=lambda one: one[0] != main)


def _bounded(p: ParameterEstimate) -> bool:
    return all(math.isfinite(end) for end in p.ci90)


def _effect(name: str) -> type[Effect] | None:
    found = port_effects().get(name)
    return found[1] if found else all_effects().get(name)


def shown_unit(name: str, word: str, unit: str, port: str = "") -> str:
    """Return the unit in which people read a parameter: per cent for shares, none at a port without a unit."""
    if unit != "-":
        return unit
    kind = _effect(name)
    p = next((q for q in kind.parameters if q.name == word), None) if kind else None
    if kind is None or p is None or _share(p):
        return "-"
    return "" if port or not (p.position or "command" in kind.hooks()) else "-"


def _share(p: Parameter) -> bool:
    return p.share or p.skew or "relative" in p.description or "share" in p.description

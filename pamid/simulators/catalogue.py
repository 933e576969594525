"""Which effects can act at which ports of a simulator, under names that contain both."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from ..constants import ATMOSPHERIC_PRESSURE
from ..effects import Effect, all_effects
from ..effects.backlash import Play
from ..effects.gas import PortOverflow
from ..effects.limits import ReadingRange
from ..effects.numbers import AddedInertia, ParameterDeviation, ParameterDrift, Payload
from ..effects.springs import LowerStop, Spring, UpperStop
from ..errors import UnknownOptionError
from ..signals.units import UNITS, Unit
from .at_links import at_link
from .base import Simulator
from .dimensions import powers, unit_powers
from .of_parameters import at_parameters
from .placement import Placement, Scales
from .placing import GAP, PASCAL, STRAIN, follows_motion, placed
from .sizes import SignalSizes
from .structure import rate_unit

_TOP = 5e5
_PREFIX = re.compile(r"^(valve|transport|actuator|sensor|output|force|flow|pressure|angle|position|velocity|speed)_")
_LENGTHS = {"m", "cm", "mm", "um", "µm", "nm", "in"}
_GEOMETRY = {"bladder_elasticity"}
NEAR_END = 1e-3
"""Accuracy of the end of a sensor's range, as a share of it."""


OF_PORTS: dict[str, tuple[str, type[Effect]]] = {
    "overflow": ("chamber", PortOverflow),
    "sensor_saturation": ("output", ReadingRange),
    "backlash": ("link", Play),
    "spring": ("link", Spring),
    "upper_stop": ("joint", UpperStop),
    "lower_stop": ("joint", LowerStop),
    "parameter_deviation": ("parameter", ParameterDeviation),
    "parameter_drift": ("parameter", ParameterDrift),
    "added_inertia": ("parameter", AddedInertia),
    "payload": ("parameter", Payload),
}
"""Effects that act at ports alone, or in another form than on the bench, by name, with the kind of port."""


def placements(simulator: Simulator, survey: SignalSizes) -> dict[str, Placement]:
    """Return every effect at every port where it can act."""
    found = [*_at_inputs(simulator, survey), *_at_outputs(simulator, survey), *_at_joints(simulator, survey)]
    found += [*_at_chambers(simulator, survey), *at_parameters(simulator)]
    found += [p for link in survey.links for p in at_link(link, survey, port_effects())]
    return {p.key: p for p in found}


def port_effects() -> dict[str, tuple[str, type[Effect]]]:
    """Return the effects that can act at ports, by their names there, with the kind of port.

    Returns
    -------
    dict of str to (str, class)
        Kind of port and effect of the library.

    Examples
    --------
    >>> from pamid.simulators import port_effects
    >>> port_effects()["actuator_dead_zone"][0], port_effects()["viscous_friction"][0]
    ('input', 'joint')
    """
    found: dict[str, tuple[str, type[Effect]]] = {}
    for name, effect in sorted(all_effects().items(), key=lambda item: _rank(item[0])):
        hooks, bare = effect.hooks(), _PREFIX.sub("", name)
        if "command" in hooks and powers(effect, "command") is not None:
            found.setdefault(f"actuator_{bare}", ("input", effect))
        if "measure" in hooks and "joint" in effect.kinds and powers(effect, "measure") is not None:
            found.setdefault(f"sensor_{bare}", ("output", effect))
            if not effect.n_states:  # lags and delays of commands are effects of their own
                found.setdefault(f"actuator_{bare}", ("input", effect))
        acts = bool({"force", "torque"} & set(hooks)) and {"joint", "motor"} & set(effect.kinds)
        if acts and name not in _GEOMETRY and powers(effect, "force") is not None:
            found.setdefault(name, ("joint", effect))
        if hooks == ("flow",) and set(effect.roles) <= {"pressure"} and effect.roles:
            found.setdefault(name, ("chamber", effect))
    return found | OF_PORTS


def _rank(name: str) -> tuple[bool, str]:
    """Return the rank of an effect among those that are equivalent at a port: a force's sensor first."""
    return not name.startswith("force"), name


def chosen(found: Mapping[str, Placement], effects: str | Sequence[str]) -> list[str]:
    """Return the keys of a choice among the library."""
    if isinstance(effects, str) and effects == "all":
        return _without_sums(found, found)
    wanted = [effects] if isinstance(effects, str) else list(effects)
    library, known = all_effects(), port_effects()
    keys: list[str] = []
    for name in wanted:
        own = [k for k, p in found.items() if name in (k, p.name) or library.get(name) is known[p.name][1]]
        if not own and name not in library and name not in known:
            raise UnknownOptionError(
                f"No effect {name!r} can act at a port of this simulator.",
                f"one of {', '.join(dict.fromkeys(p.name for p in found.values()))}",
                "Correct the name.",
            )
        keys += own
    return _without_sums(dict.fromkeys(keys), found)


def _without_sums(keys: Iterable[str], found: Mapping[str, Placement]) -> list[str]:
    """Return a choice without frictions by direction that are the sum of a Coulomb friction and an offset in it."""
    some = [found[k] for k in keys]
    dry = {p.port for p in some if p.name == "coulomb_friction" and any(o.name == "actuator_bias" for o in some)}
    return [p.key for p in some if p.name != "directional_friction" or p.port not in dry]


# --- the kinds of ports -------------------------------------------------------------------------------------
def _at_inputs(simulator: Simulator, survey: SignalSizes) -> list[Placement]:
    found = []
    for port in simulator.ports:
        span = survey.spans.get(port.name, 0.0)
        if port.kind != "input" or not span > 0.0:
            continue
        for name, (kind, effect) in port_effects().items():
            if kind == "input":
                hook = "command" if "command" in effect.hooks() else "measure"
                scales = Scales(time=survey.time, command=0.5 * span, target=0.01 * span)
                hidden = tuple(
                    p.name
                    for p in effect.parameters
                    if (p.share and p.nominal == 0.0) or (p.skew and not survey.turns(port.name))
                )
                found.append(placed(
                    name, effect, port.name, hook, "input", port.name, {}, scales, port.unit, port.unit, hidden,
                    reach=survey.tops.get(port.name, span),
                ))  # fmt: skip
    return found


def _at_outputs(simulator: Simulator, survey: SignalSizes) -> list[Placement]:
    found, own = [], {f"{name}@{where}": values for name, where, values in simulator.effects}
    for port in survey.readings:
        span = survey.spans.get(port, 0.0)
        if not span > 0.0:
            continue
        unit, scales = simulator.port(port).unit, Scales(time=survey.time, target=0.01 * span)
        for name, (kind, effect) in port_effects().items():
            if kind == "output":
                end, reach = survey.ends.get(port, 0.0), survey.tops.get(port, span)
                if issubclass(effect, ReadingRange):
                    side = survey.one_sided.get(port, 0) or ReadingRange.side_of(own.get(f"{name}@{port}", {}))
                    effect, reach = effect.ending(side), end if side else reach
                found.append(placed(
                    name, effect, port, "measure", "output", port, {}, scales, unit, unit,
                    reach=reach, least=(1.0 - NEAR_END) * end,
                ))  # fmt: skip
    return found


def _at_joints(simulator: Simulator, survey: SignalSizes) -> list[Placement]:
    found = []
    for joint in survey.joints:
        span = survey.spans.get(joint.position) or survey.spans.get(f"{joint.name}.path", 0.0)
        if not span > 0.0:
            continue
        unit = simulator.port(joint.position).unit if joint.position else _travel(simulator.port(joint.velocity).unit)
        size = survey.gaps.get(joint.name, survey.gaps.get(joint.velocity, 0.0))
        if joint.through:
            size /= abs(survey.pushes.get((joint.through, joint.velocity), 1.0)) or 1.0
        follows = {"position": joint.position or f"{joint.name}.path", "velocity": joint.velocity}
        enters, at = ("input", joint.through) if joint.through else ("state", joint.velocity)
        for name, (kind, effect) in port_effects().items():
            if name == "back_emf" and joint.unit != "V":
                continue  # in volts it is equivalent to viscous friction: both are reported
            if name == "gravity" and unit in _LENGTHS:
                continue  # no lever turns: along a travel a weight is an offset
            if kind != "joint" or not follows_motion(effect):
                continue
            scale = 1.0 if effect.site == "joint" else span / STRAIN
            if issubclass(effect, UpperStop) and not joint.position:
                continue
            scales = Scales(scale, survey.time, size / GAP["force"] or 1.0)
            hidden = tuple(p.name for p in effect.parameters if p.neutral or "Pa" in unit_powers(p.unit))
            used = {r: s for r, s in follows.items() if r in effect.roles}
            prior = 0.0 if name == "quadratic_drag" else None  # outside of muscles as likely as any friction
            made = placed(
                name, effect, joint.name, "force", enters, at, used, scales, joint.unit, unit, hidden, prior,
                range_of=span / scale, speed=scales.speed(survey.spans.get(joint.velocity, 0.0)),
                interval=survey.interval,
            )  # fmt: skip
            if issubclass(effect, UpperStop):
                low = survey.lows[joint.position] / scale
                made = replace(made, effect=effect.within(low, low + span / scale))
            found.append(made)
    return found


def _travel(unit: str) -> str:
    return unit.removesuffix("/s") or "-"


def _at_chambers(simulator: Simulator, survey: SignalSizes) -> list[Placement]:
    found = []
    moving = {n for j in survey.joints for n in (j.position, j.velocity)}
    chambers = {p.level: (p.name, p.through, p.unit) for p in simulator.ports if p.kind == "chamber"}
    levels = simulator.states if simulator.form == "ode" else [p for p in chambers if p in survey.readings]
    for state in levels:
        span = survey.spans.get(state, 0.0)
        if state in moving or not span > 0.0:
            continue
        name, through, unit = chambers.get(state, (state, "", rate_unit(simulator, state)))
        size, push = survey.gaps.get(state, 0.0), 1.0
        if through:
            push = abs(survey.pushes.get((through, state), 1.0)) or 1.0
            size, unit = size / push, simulator.port(through).unit
        domain = "temperature" if _temperature(simulator.port(state).unit) else "store"
        for effect_name, (kind, found_effect) in port_effects().items():
            if kind == "chamber" and found_effect.domain == domain:
                effect, into = found_effect, ""
                head = _head(simulator.port(state).unit, survey, state)
                scales = Scales(time=survey.time, target=size / GAP["flow"] or 1.0, **head)
                if effect_name == "overflow":
                    fastest = 1.0 / (survey.interval * push * scales.target * scales.pressure)
                    low = survey.lows[state]
                    effect = _within(effect, head, low, survey.highs.get(state, low + span), fastest)
                    into = "" if through else survey.feeds.get(state, "")
                enters, at = ("input", through) if through else ("state", state)
                hidden = () if into else ("returned",)
                leak = placed(
                    effect_name, effect, name, "flow", enters, at, {"pressure": state}, scales, unit,
                    simulator.port(state).unit, hidden,
                )  # fmt: skip
                found.append(replace(leak, into=into))
    return found


def _within(effect: type[Effect], head: Mapping[str, float], low: float, high: float, fastest: float) -> type[Effect]:
    """Return an overflow whose level lies within the log's range, and which is no faster than a sample."""
    low, high = (x * head["pressure"] + head.get("offset", 0.0) for x in (low, high))
    changed = []
    for p in effect.parameters:
        if p.name == "level":
            edge = 0.02 * (high - low)
            p = replace(p, lower=low + edge, upper=high - edge, nominal=0.5 * (low + high), essential=True)
        if p.name == "coefficient":
            p = replace(p, upper=min(p.upper, fastest), nominal=min(p.nominal, 0.1 * fastest))
        changed.append(p)
    return effect.narrowed(parameters=changed)


def _temperature(unit: str) -> Unit | None:
    """Return a unit as one of temperature; None if it is another."""
    known = UNITS.get(unit)
    return known if known is not None and known.dimension == "temperature" else None


def _head(unit: str, survey: SignalSizes, state: str) -> dict[str, float]:
    """Return how a stored quantity acts as a pressure: a gas relative to the surroundings, a level absolutely."""
    if kelvin := _temperature(unit):
        return {"pressure": kelvin.factor, "offset": kelvin.offset}
    if unit not in PASCAL:
        return {"pressure": _TOP / survey.tops[state]}
    factor = PASCAL[unit]
    gauge = factor * survey.lows.get(state, 0.0) < 0.5 * ATMOSPHERIC_PRESSURE
    offset = ATMOSPHERIC_PRESSURE if gauge else 0.0
    return {"pressure": factor, "offset": offset, "ambient": ATMOSPHERIC_PRESSURE}


def in_port_units(name: str, where: str, values: Mapping[str, float]) -> Effect:
    """Return an effect that acts in the units of its port, without the bounds of a bench or log."""
    kind, cls = port_effects()[name]
    hook = "command" if "command" in cls.hooks() else "measure" if kind in ("input", "output") else "force"
    known = (powers(cls, hook) if kind != "chamber" else None) or {}
    return Placement(f"{name}@{where}", name, where, cls, kind, where, {}, Scales(), known).made(values)


def effect_class(name: str) -> type[Effect]:
    """Return the effect of a name: one of the library, or of those at ports with or without the port."""
    plain, known = name.partition("@")[0], all_effects()
    return known[plain] if plain in known else port_effects()[plain][1]

"""Which effects can act at which ports of a simulator, under names that contain both."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from ..constants import ATMOSPHERIC_PRESSURE
from ..effects import Effect, all_effects
from ..effects.backlash import Play
from ..effects.gas import PortOverflow
from ..effects.leakage import PortLeakage
from ..effects.limits import ForceLimit, ReadingRange
from ..effects.numbers import AddedInertia, ParameterDeviation, ParameterDrift, ParameterDriftInRuns, Payload
from ..effects.readings import AngleGain
from ..effects.ripples import PeriodicReading
from ..effects.springs import LowerStop, Spring, UpperStop
from ..effects.steady import SteadyForce, SteadyHeating, SteadyInflow
from ..errors import UnknownOptionError
from ..signals.units import UNITS, Unit
from .at_links import at_link
from .base import Simulator
from .dimensions import powers
from .of_parameters import at_parameters
from .placement import Placement, Scales
from .placing import GAP, PASCAL, STRAIN, PortPlace, follows_motion, hidden_of, powers_at
from .sizes import SignalSizes
from .structure import rate_unit

_TOP = 5e5
_PREFIX = re.compile(r"^(valve|transport|actuator|sensor|output|force|flow|pressure|angle|position|velocity|speed)_")
_LENGTHS = {"m", "cm", "mm", "um", "µm", "nm", "in"}
_GEOMETRY = {"bladder_elasticity"}
EDGE = 0.02
"""Share of a level's range by which noise may take it below zero."""
NEAR_END = 1e-3
"""Accuracy of the end of a sensor's range, as a share of it."""


OF_PORTS: dict[str, tuple[str, type[Effect]]] = {
    "overflow": ("chamber", PortOverflow),
    "leakage": ("chamber", PortLeakage),
    "sensor_ripple": ("output", PeriodicReading),
    "sensor_saturation": ("output", ReadingRange),
    "backlash": ("link", Play),
    "spring": ("joint", Spring),
    "encoder_gain": ("encoder", AngleGain),
    "upper_stop": ("joint", UpperStop),
    "lower_stop": ("joint", LowerStop),
    "steady_force": ("joint", SteadyForce),
    "steady_inflow": ("chamber", SteadyInflow),
    "steady_heating": ("chamber", SteadyHeating),
    "parameter_deviation": ("parameter", ParameterDeviation),
    "parameter_drift": ("parameter", ParameterDrift),
    "parameter_drift_in_runs": ("parameter", ParameterDriftInRuns),
    "added_inertia": ("parameter", AddedInertia),
    "payload": ("parameter", Payload),
    "force_limit": ("parameter", ForceLimit),
}
"""Effects that act at ports alone, or in another form than on the bench, by name, with the kind of port."""


def placements(simulator: Simulator, survey: SignalSizes) -> dict[str, Placement]:
    """Return every effect at every port where it can act."""
    found = [*_at_inputs(simulator, survey), *_at_outputs(simulator, survey), *_at_joints(simulator, survey)]
    found += [*_at_encoders(simulator, survey), *_at_chambers(simulator, survey), *at_parameters(simulator, survey)]
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
    # Among those that are equivalent at a port a force's sensor comes first.
    for name, effect in sorted(all_effects().items(), key=lambda item: (not item[0].startswith("force"), item[0])):
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


def _effects_at(kind: str) -> list[tuple[str, type[Effect]]]:
    return [(name, effect) for name, (own, effect) in port_effects().items() if own == kind]


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
def _at_inputs(simulator: Simulator, survey: SignalSizes) -> Iterator[Placement]:
    for port in simulator.ports:
        span = survey.spans.get(port.name, 0.0)
        if port.kind != "input" or not span > 0.0:
            continue
        reach = survey.tops.get(port.name, span)
        scales = Scales(time=survey.time, command=min(reach, span), target=0.01 * span)
        place = PortPlace(port.name, "input", "input", port.name, scales, port.unit, port.unit, reach=reach)
        turns = survey.turns(port.name)
        for name, effect in _effects_at("input"):
            more = [p.name for p in effect.parameters if p.share and not p.nominal]
            simple = [p.name for p in effect.parameters if p.skew and not turns]
            # What follows with a lag may swing, too.
            yield place.placed(name, effect, (*simple, *(() if effect.n_states else more)))


def _at_outputs(simulator: Simulator, survey: SignalSizes) -> Iterator[Placement]:
    own = {f"{name}@{where}": values for name, where, values in simulator.effects}
    positions = {j.position for j in survey.joints}
    for port in survey.readings:
        span, end = survey.spans.get(port, 0.0), survey.ends.get(port, 0.0)
        if not span > 0.0:
            continue
        unit, scales = simulator.port(port).unit, Scales(time=survey.time, target=0.01 * span)
        reach, least = survey.tops.get(port, span), (1.0 - NEAR_END) * end
        place = PortPlace(
            port, "output", "output", port, scales, unit, unit, reach=reach, least=least, range_of=span / scales.target,
            turn=_turn(unit) / scales.target,
        )  # fmt: skip
        way = _dimension(unit) in ("angle", "length") or port in positions
        for name, effect in _effects_at("output"):
            if issubclass(effect, PeriodicReading):
                if way:  # what repeats does so along a way
                    yield _repeated(place.placed(name, effect))
            elif issubclass(effect, ReadingRange):
                side = survey.one_sided.get(port, 0) or ReadingRange.side_of(own.get(f"{name}@{port}", {}))
                yield replace(place, reach=end if side else reach).placed(name, effect.ending(side))
            else:
                yield place.placed(name, effect)


def _repeated(place: Placement) -> Placement:
    """Return a periodic effect with two periods and more in the range: a curve over fewer may be any other."""
    within = [replace(p, lower=2.0 * p.lower) if p.periods else p for p in place.effect.parameters]
    return replace(place, effect=place.effect.narrowed(parameters=within))


def _at_encoders(simulator: Simulator, survey: SignalSizes) -> Iterator[Placement]:
    """Yield faults of a sensor whose position and speed are both read, so that both are wrong alike."""
    for joint in survey.joints:
        if {joint.position, joint.velocity} <= set(survey.readings):
            unit = simulator.port(joint.position).unit
            place = PortPlace(joint.name, "output", "output", joint.position, Scales(time=survey.time), unit, unit)
            for name, effect in _effects_at("encoder"):
                yield replace(place.placed(name, effect), also={"velocity": joint.velocity})


def _at_joints(simulator: Simulator, survey: SignalSizes) -> Iterator[Placement]:
    drives, moved = simulator.driven().values(), {n for n, span in survey.spans.items() if span > 0.0}
    driven = survey.driven | {j.velocity for j in survey.joints if j.name in drives or j.through in moved}
    for joint in survey.joints:
        position = joint.position or f"{joint.name}.path"
        span = survey.spans.get(position, 0.0)
        if not span > 0.0:
            continue
        unit = simulator.port(joint.position or joint.velocity).unit
        if not joint.position:
            unit = unit.removesuffix("/s") or "-"
        size = survey.gaps.get(joint.name, survey.gaps.get(joint.velocity, 0.0))
        if joint.through:
            size /= survey.pushes.get((joint.through, joint.velocity), 1.0)
        size /= joint.lever.typical if joint.lever else 1.0
        enters, at = ("input", joint.through) if joint.through else ("state", joint.velocity)
        for name, effect in _effects_at("joint"):
            if name == "back_emf" and joint.unit != "V":
                continue  # in volts it is equivalent to viscous friction: both are reported
            if name == "gravity" and unit in _LENGTHS:
                continue  # no lever turns: along a travel a weight is an offset
            if effect is SteadyForce and joint.velocity in driven:
                continue  # a bias of the input there is the same
            if not follows_motion(effect) or (issubclass(effect, UpperStop) and not joint.position):
                continue
            scale = 1.0 if effect.site == "joint" else span / STRAIN
            scales = Scales(scale, survey.time, size / GAP["force"] or 1.0)
            place = PortPlace(
                joint.name, "joint", enters, at, scales, joint.unit, unit,
                {"position": position, "velocity": joint.velocity}, range_of=span / scale, turn=_turn(unit) / scale,
                speed=scales.speed(survey.spans.get(joint.velocity, 0.0)), interval=survey.interval,
            )  # fmt: skip
            made = replace(place.placed(name, effect, hidden_of(effect)), lever=joint.lever)
            if issubclass(effect, UpperStop):
                low = survey.lows[joint.position] / scale
                made = replace(made, effect=effect.within(low, low + span / scale))
            yield made


def _at_chambers(simulator: Simulator, survey: SignalSizes) -> Iterator[Placement]:
    moving = {n for j in survey.joints for n in (j.position, j.velocity)}
    chambers = {p.level: (p.name, p.through, p.unit) for p in simulator.ports if p.kind == "chamber"}
    levels = simulator.states if simulator.form == "ode" else [p for p in chambers if p in survey.readings]
    for state in levels:
        span, signal = survey.spans.get(state, 0.0), simulator.port(state).unit
        if state in moving or not span > 0.0:
            continue
        name, through, unit = chambers.get(state, (state, "", "-"))
        unit = rate_unit(simulator, state) if not through and unit == "-" else unit
        size, push = survey.gaps.get(state, 0.0), survey.pushes.get((through, state), 1.0)
        if push < 0.0:  # what flows with it empties the store
            through, unit, push = "", rate_unit(simulator, state), 1.0
        if through:
            size, unit = size / push, simulator.port(through).unit
        scales = Scales(time=survey.time, target=size / GAP["flow"] or 1.0, **_head(signal, survey, state))
        enters, at = ("input", through) if through else ("state", state)
        place = PortPlace(name, "chamber", enters, at, scales, unit, signal, {"pressure": state})
        domain = "temperature" if _temperature(signal) else "store"
        signed = survey.lows.get(state, 0.0) < -EDGE * span  # no level, but a current, say
        for effect_name, effect in _effects_at("chamber"):
            if effect.domain != domain or (issubclass(effect, SteadyInflow) and (through or state in survey.driven)):
                continue
            into = ""
            hidden: tuple[str, ...] = ()
            if issubclass(effect, PortOverflow) and signed:
                continue
            if issubclass(effect, PortOverflow):
                low = survey.lows[state]
                bottom, top = (x * scales.pressure + scales.offset for x in (low, survey.highs.get(state, low + span)))
                fastest = 1.0 / (survey.interval * push * scales.target * scales.pressure)
                effect, into = effect.within(bottom, top, fastest), "" if through else survey.feeds.get(state, "")
                hidden = () if into else ("returned",)
            elif issubclass(effect, PortLeakage):
                effect = effect.narrowed(unit_size=scales.pressure, of_mass=unit == "kg/s")
                hidden = ("exponent",) if signed or scales.ambient else ()
            yield replace(place.placed(effect_name, effect, hidden), into=into)


def _turn(unit: str) -> float:
    """Return a full turn in a unit of angles, 0 in any other."""
    return math.tau / float(UNITS[unit].factor) if _dimension(unit) == "angle" else 0.0


def _dimension(unit: str) -> str:
    """Return the dimension of a unit; empty for an unknown one."""
    return UNITS[unit].dimension if unit in UNITS else ""


def _temperature(unit: str) -> Unit | None:
    """Return a unit as one of temperature; None if it is another."""
    return UNITS[unit] if _dimension(unit) == "temperature" else None


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
    known = powers_at(kind, cls)
    return Placement(f"{name}@{where}", name, where, cls, kind, where, {}, Scales(), known).made(values)


def effect_class(name: str, at_ports: bool) -> type[Effect]:
    """Return the effect that acts under a name, which may say where and in which logs: at ports in its form there."""
    plain, here = name.partition("@")[0], port_effects() if at_ports else {}
    return here[plain][1] if plain in here else all_effects()[plain]

"""Effects on the numbers of a simulator: a wrong one, a drifting one, or an omitted inertia."""

from __future__ import annotations

from dataclasses import replace

from ..effects.limits import ForceLimit
from ..effects.numbers import (
    AddedInertia,
    ContactFriction,
    ParameterDeviation,
    ParameterDrift,
    ParameterDriftInRuns,
    Payload,
)
from .base import Carried, Limited, Simulator
from .placement import Placement, Scales
from .sizes import SignalSizes
from .structure import JointPort

MOST_PAYLOAD = 10.0
"""Heaviest payload, in masses of the whole."""
LEAST_LIMIT = 0.01
"""Least limit of an actuator's force, as a share of the largest force that it has without one."""
FIXED = (ParameterDeviation, AddedInertia, ContactFriction, Payload, ForceLimit)
"""Those that change numbers by a constant amount along a log."""


def at_parameters(simulator: Simulator, survey: SignalSizes) -> list[Placement]:
    """Return the effects at the numbers of a simulator."""
    found = []
    known = {"parameter_deviation": ParameterDeviation, "parameter_drift": ParameterDrift}
    if survey.again > 0.0 and simulator.form != "run":  # in a single run both drifts are one; numbers of runs are fixed
        known["parameter_drift_in_runs"] = ParameterDriftInRuns
    scales = Scales(time=1.0 / (survey.again or 1.0))
    # What a page does not state is friction of the law, not a wrong number.
    dry = {
        joint: name for joint, (name, own) in simulator.dry_joints().items()
        if (simulator.get(name), simulator.parameters[name].tolerance) == (own, 0.0)
    }  # fmt: skip
    for name, parameter in simulator.parameters.items():
        if parameter.value == 0.0 or name in dry.values():
            continue
        for effect_name, of_one in known.items():
            effect = of_one.narrowed(prior=-1.0)
            key, units = f"{effect_name}@{name}", {p.name: p.unit for p in effect.parameters}
            found.append(Placement(key, effect_name, name, effect, "parameter", name, {}, scales, {}, units))
    for joint, (name, size) in simulator.joint_inertias().items():
        if simulator.get(name) == 0.0 and size > 0.0:
            key, bound = f"added_inertia@{joint}", AddedInertia.narrowed(size=size)
            powers, units = {"inertia": 1}, {"inertia": simulator.parameters[name].unit}
            place = Scales(target=size)
            found.append(Placement(key, "added_inertia", joint, bound, "parameter", name, {}, place, powers, units))
    found += [_dry_friction(simulator, j, dry[j.name], survey) for j in survey.joints if j.name in dry]
    for name, limited in survey.limited.items():
        if simulator.get(limited.number) == 0.0 and limited.largest > 0.0:
            found.append(_force_limit(simulator, name, limited))
    for body, load in simulator.carried().items():
        if simulator.get(load.numbers["value"]) == 0.0:
            found.append(_payload(body, load))
    return found


def _dry_friction(simulator: Simulator, joint: JointPort, number: str, survey: SignalSizes) -> Placement:
    """Return Coulomb friction of the simulator's own solver, whose law at low speed is another than the library's."""
    size = survey.gaps.get(joint.name, survey.gaps.get(joint.velocity, 0.0))
    size = size / survey.pushes.get((joint.through, joint.velocity), 1.0) or 1.0
    [level], unit = ContactFriction.parameters, simulator.parameters[number].unit
    effect = ContactFriction.narrowed(parameters=[replace(level, nominal=size, upper=100.0 * size)])
    key, units = f"coulomb_friction@{joint.name} (in the solver)", {"amplitude": unit}
    return Placement(key, "coulomb_friction", joint.name, effect, "parameter", number, {}, Scales(), {}, units)


def _force_limit(simulator: Simulator, name: str, limited: Limited) -> Placement:
    """Return the limit of an actuator's force, sought below the largest one that it has on the log."""
    [limit], unit = ForceLimit.parameters, simulator.parameters[limited.number].unit
    top, least = limited.largest, LEAST_LIMIT * limited.largest
    effect = ForceLimit.narrowed(parameters=[replace(limit, lower=least, upper=top, nominal=(top * least) ** 0.5)])
    key, units = f"force_limit@{name}", {"limit": unit}
    return Placement(key, "force_limit", name, effect, "parameter", limited.number, {}, Scales(), {}, units)


def _payload(body: str, load: Carried) -> Placement:
    """Return a payload on a body, sought from the body's centre on."""
    mass, *place = Payload.parameters
    known = [replace(mass, upper=MOST_PAYLOAD * load.mass, nominal=0.01 * load.mass)]
    for p, centre in zip(place, load.centre, strict=True):
        known.append(replace(p, lower=centre - load.reach, upper=centre + load.reach, nominal=centre))
    effect, units = Payload.narrowed(parameters=known), {p.name: p.unit for p in known}
    value, others = load.numbers["value"], {k: v for k, v in load.numbers.items() if k != "value"}
    key = f"payload@{body}"
    return Placement(key, "payload", body, effect, "parameter", value, {}, Scales(), {}, units, also=others)

"""Effects on the numbers of a simulator: a wrong one, a drifting one, or an omitted inertia."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..effects import Effect, Parameter
from .base import Carried, Simulator
from .placement import Placement, Scales, narrowed


class ParameterDeviation(Effect):
    r"""A parameter that deviates by more than its tolerance: :math:`p' = p\,(1 + \delta)`, by any positive factor."""

    family = "parameter"
    equations = ()
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("deviation", "-", -1.0 + 1e-6, 1e6, 0.1, "relative deviation", factor=True),)
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed value."""
        return {"value": values["value"] * (1.0 + self.deviation)}


class ParameterDrift(Effect):
    r"""A parameter that drifts over the log: :math:`p' = p\,(1 + d\,(s - \tfrac12))`, s going from 0 to 1 along it."""

    family = "parameter"
    equations = ()
    source = "10.1007/3-540-30368-5"
    parameters = (Parameter("drift", "-", -0.9, 0.9, 0.1, "relative change from the beginning of the log to its end"),)
    drift: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the value at a share ``along`` of the log."""
        return {"value": values["value"] * (1.0 + self.drift * (values["along"] - 0.5))}


class AddedInertia(Effect):
    r"""Inertia at a joint that the simulator leaves out, such as that of a motor behind a gear: :math:`I' = I + I_m`.

    References
    ----------
    R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, section 9.6.
    https://doi.org/10.1007/978-1-4899-7560-7
    """

    family = "load"
    equations = ()
    source = "10.1007/978-1-4899-7560-7"
    parameters = (Parameter("inertia", "-", 0.0, 50.0, 0.1, "inertia at the joint, as a share of its own"),)
    inertia: float
    size = 1.0
    """Inertia that the joint has, in the unit of the number that it is added to."""

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed value."""
        return {"value": values["value"] + self.inertia * self.size}


class Payload(Effect):
    r"""A load that the simulator leaves out: a point mass at a place of a body, in the body's frame.

    It adds :math:`m` to the body's mass, :math:`m\,r` to its first moment and :math:`m\,(|r|^2 1 - r r^\top)` to its
    inertia.

    References
    ----------
    R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, section 2.13.
    https://doi.org/10.1007/978-1-4899-7560-7
    """

    family = "load"
    equations = ()
    source = "10.1007/978-1-4899-7560-7"
    parameters = (
        Parameter("mass", "kg", 0.0, 1e4, 0.1, "mass of the load", linear=True),
        *(
            Parameter(axis, "m", -10.0, 10.0, 0.0, f"its place along {axis} of the body's frame", refines=True)
            for axis in "xyz"
        ),
    )
    mass: float
    x: float
    y: float
    z: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the mass and place of the body's load: two loads are one at their common centre."""
        mass = values["value"] + self.mass
        share = self.mass / np.maximum(mass, np.finfo(float).tiny)
        place = {axis: values[axis] + share * (getattr(self, axis) - values[axis]) for axis in "xyz"}
        return {"value": mass, **place}


MOST_PAYLOAD = 10.0
"""Heaviest payload, in masses of the whole."""
OF_PARAMETERS: dict[str, type[Effect]] = {
    "parameter_deviation": ParameterDeviation,
    "parameter_drift": ParameterDrift,
    "added_inertia": AddedInertia,
    "payload": Payload,
}
"""By name. Each changes a number of the simulator; all but a drift by a constant amount."""
FIXED = (ParameterDeviation, AddedInertia, Payload)
"""Those that change numbers by a constant amount along a log."""


def at_parameters(simulator: Simulator) -> list[Placement]:
    """Return the effects at the numbers of a simulator."""
    found = []
    for name, parameter in simulator.parameters.items():
        if parameter.value == 0.0:
            continue
        for effect_name in ("parameter_deviation", "parameter_drift"):
            effect = narrowed(OF_PARAMETERS[effect_name], prior=-1.0)
            key, units = f"{effect_name}@{name}", {p.name: "-" for p in effect.parameters}
            found.append(Placement(key, effect_name, name, effect, "parameter", name, {}, Scales(), {}, units))
    for joint, (name, size) in simulator.joint_inertias().items():
        if simulator.get(name) == 0.0 and size > 0.0:
            key, bound = f"added_inertia@{joint}", narrowed(AddedInertia, size=size)
            powers, units = {"inertia": 1}, {"inertia": simulator.parameters[name].unit}
            place = Scales(target=size)
            found.append(Placement(key, "added_inertia", joint, bound, "parameter", name, {}, place, powers, units))
    for body, load in simulator.carried().items():
        if simulator.get(load.numbers["value"]) == 0.0:
            found.append(_payload(body, load))
    return found


def _payload(body: str, load: Carried) -> Placement:
    """Return a payload on a body, sought from the body's centre on."""
    mass, *place = Payload.parameters
    known = [replace(mass, upper=MOST_PAYLOAD * load.mass, nominal=0.01 * load.mass)]
    for p, centre in zip(place, load.centre, strict=True):
        known.append(replace(p, lower=centre - load.reach, upper=centre + load.reach, nominal=centre))
    effect, units = narrowed(Payload, parameters=known), {p.name: p.unit for p in known}
    value, others = load.numbers["value"], {k: v for k, v in load.numbers.items() if k != "value"}
    key = f"payload@{body}"
    return Placement(key, "payload", body, effect, "parameter", value, {}, Scales(), {}, units, also=others)

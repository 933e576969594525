"""Effects on the numbers of a simulator: a wrong one, a drifting one, or an omitted inertia."""

from __future__ import annotations

from collections.abc import Mapping

from ..effects import Effect, Parameter
from .base import Simulator
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


OF_PARAMETERS: dict[str, type[Effect]] = {
    "parameter_deviation": ParameterDeviation,
    "parameter_drift": ParameterDrift,
    "added_inertia": AddedInertia,
}
"""By name. Each changes a number of the simulator; all but a drift by a constant amount."""
FIXED = (ParameterDeviation, AddedInertia)
"""Those that change a number by a constant amount along a log."""


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
    return found

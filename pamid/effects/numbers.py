"""Numbers of a simulator that are wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from .base import Effect
from .values import parameter


class _Deviation(Effect):
    """A number of a simulator that deviates by a share of it."""

    of: ClassVar[str]
    """Its name there."""
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed number."""
        return {self.of: values[self.of] * (1.0 + self.deviation)}


class BraidAngle(_Deviation):
    r"""A braid wound at another angle. θ₀ → θ₀ (1 + δ)."""

    name = "braid_angle"
    family = "geometry"
    equations = ("force", "flow")
    of = "braid_angle"
    source = "10.1109/70.481753"
    deviation = parameter("-", -0.3, 0.3, 0.1, "relative deviation of the braid angle")


class Diameter(_Deviation):
    r"""A muscle thicker or thinner than its drawing. D₀ → D₀ (1 + δ)."""

    name = "diameter"
    family = "geometry"
    equations = ("force", "flow")
    of = "rest_diameter"
    source = "10.1109/70.481753"
    deviation = parameter("-", -0.5, 1.0, 0.1, "relative deviation of the rest diameter")


class Length(_Deviation):
    r"""A muscle longer or shorter than its drawing. L₀ → L₀ (1 + δ)."""

    name = "length"
    family = "geometry"
    equations = ("force", "flow")
    of = "rest_length"
    source = "10.1109/70.481753"
    deviation = parameter("-", -0.5, 1.0, 0.1, "relative deviation of the rest length")


class Inertia(_Deviation):
    r"""Inertia of the load that differs from the assumed one. J → J (1 + δ)."""

    name = "inertia"
    family = "load"
    equations = ("joint",)
    of = "inertia"
    source = "10.1109/37.833638"
    deviation = parameter("-", -0.8, 5.0, 0.1, "relative deviation of the inertia")


class ValveConductance(_Deviation):
    r"""Different sonic conductance: C → C (1 + δ)."""

    name = "valve_conductance"
    family = "valve"
    equations = ("valve",)
    of = "sonic_conductance"
    source = "ISO 6358-1:2013"
    deviation = parameter("-", -0.9, 2.0, 0.15, "relative deviation", linear=True)


class ParameterDeviation(_Deviation):
    r"""A parameter that deviates by more than its tolerance: :math:`p' = p\,(1 + \delta)`, by any positive factor."""

    family = "parameter"
    of = "value"
    source = "10.1007/3-540-30368-5"
    deviation = parameter("-", -1.0 + 1e-6, 1e6, 0.1, "relative deviation", factor=True)


class ParameterDrift(Effect):
    r"""A parameter that drifts over the log: :math:`p' = p\,(1 + d\,(s - \tfrac12))`, s going from 0 to 1 along it."""

    family = "parameter"
    source = "10.1007/3-540-30368-5"
    drift = parameter("-", -0.9, 0.9, 0.1, "relative change from the beginning of the log to its end")

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the value at a share ``along`` of the log."""
        return {"value": values["value"] * (1.0 + self.drift * (values["along"] - 0.5))}


class ParameterDriftInRuns(Effect):
    r"""A parameter that drifts from its value anew in every run: :math:`p' = p\,(1 + r\,t)`, t since the run began."""

    family = "parameter"
    source = "10.1007/3-540-30368-5"
    rate = parameter("1/s", -0.9, 0.9, 0.1, "relative change per second")

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the value at a time ``since`` the beginning of a run."""
        return {"value": values["value"] * (1.0 + self.rate * values["since"])}


class AddedInertia(Effect):
    r"""Inertia at a joint that the simulator leaves out, such as that of a motor behind a gear: :math:`I' = I + I_m`.

    References
    ----------
    R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, section 9.6.
    https://doi.org/10.1007/978-1-4899-7560-7
    """

    family = "load"
    source = "10.1007/978-1-4899-7560-7"
    inertia = parameter("-", 0.0, 50.0, 0.1, "inertia at the joint, as a share of its own")
    size = 1.0
    """Inertia that the joint has, in the unit of the number that it is added to."""

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed value."""
        return {"value": values["value"] + self.inertia * self.size}


class ContactFriction(Effect):
    r"""Dry friction as a solver of contacts has it: at rest it balances the drive, up to :math:`F_c`.

    References
    ----------
    E. Todorov, "Convex and analytically-invertible dynamics with contacts and constraints", ICRA 2014.
    https://doi.org/10.1109/ICRA.2014.6907751
    """

    family = "friction"
    source = "10.1109/ICRA.2014.6907751"
    amplitude = parameter("N", 0.0, 1e4, 1.0, "sliding friction", symbol="F_c")

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed value."""
        return {"value": values["value"] + self.amplitude}


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
    source = "10.1007/978-1-4899-7560-7"
    mass = parameter("kg", 0.0, 1e4, 0.1, "mass of the load", linear=True)
    x = parameter("m", -10.0, 10.0, 0.0, "its place along x of the body's frame", refines=True)
    y = parameter("m", -10.0, 10.0, 0.0, "its place along y of the body's frame", refines=True)
    z = parameter("m", -10.0, 10.0, 0.0, "its place along z of the body's frame", refines=True)

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the mass and place of the body's load: two loads are one at their common centre."""
        mass = values["value"] + self.mass
        share = self.mass / np.maximum(mass, np.finfo(float).tiny)
        place = {axis: values[axis] + share * (getattr(self, axis) - values[axis]) for axis in "xyz"}
        return {"value": mass, **place}

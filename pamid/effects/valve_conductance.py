"""A valve larger or smaller than its data sheet says."""

from __future__ import annotations

from ._laws import Deviation
from .values import Parameter


class ValveConductance(Deviation):
    r"""Different sonic conductance: C → C (1 + δ)."""

    name = "valve_conductance"
    family = "valve"
    equations = ("valve",)
    of = "sonic_conductance"
    source = "ISO 6358-1:2013"
    parameters = (Parameter("deviation", "-", -0.9, 2.0, 0.15, "relative deviation", linear=True),)

"""Inertia of the load that differs from the assumed one."""

from __future__ import annotations

from ._laws import Deviation
from .values import Parameter


class Inertia(Deviation):
    r"""Inertia of the load that differs from the assumed one. J → J (1 + δ)."""

    name = "inertia"
    family = "load"
    equations = ("joint",)
    of = "inertia"
    source = "10.1109/37.833638"
    parameters = (Parameter("deviation", "-", -0.8, 5.0, 0.1, "relative deviation of the inertia"),)

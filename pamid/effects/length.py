"""A muscle longer or shorter than its drawing."""

from __future__ import annotations

from ._laws import Deviation
from .values import Parameter


class Length(Deviation):
    r"""A muscle longer or shorter than its drawing. L₀ → L₀ (1 + δ)."""

    name = "length"
    family = "geometry"
    equations = ("force", "flow")
    of = "rest_length"
    source = "10.1109/70.481753"
    parameters = (Parameter("deviation", "-", -0.5, 1.0, 0.1, "relative deviation of the rest length"),)

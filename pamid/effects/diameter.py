"""A muscle thicker or thinner than its drawing."""

from __future__ import annotations

from ._laws import Deviation
from .values import Parameter


class Diameter(Deviation):
    r"""A muscle thicker or thinner than its drawing. D₀ → D₀ (1 + δ)."""

    name = "diameter"
    family = "geometry"
    equations = ("force", "flow")
    of = "rest_diameter"
    source = "10.1109/70.481753"
    parameters = (Parameter("deviation", "-", -0.5, 1.0, 0.1, "relative deviation of the rest diameter"),)

"""A braid wound at another angle."""

from __future__ import annotations

from ._laws import Deviation
from .values import Parameter


class BraidAngle(Deviation):
    r"""A braid wound at another angle. θ₀ → θ₀ (1 + δ)."""

    name = "braid_angle"
    family = "geometry"
    equations = ("force", "flow")
    of = "braid_angle"
    source = "10.1109/70.481753"
    parameters = (Parameter("deviation", "-", -0.3, 0.3, 0.1, "relative deviation of the braid angle"),)

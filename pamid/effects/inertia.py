"""Inertia of the load other than assumed."""

from __future__ import annotations

from collections.abc import Mapping

from .base import Effect
from .values import Parameter


class Inertia(Effect):
    r"""Inertia of the load other than assumed. J → J (1 + δ).

    Parameters
    ----------
    **values : float
        ``deviation`` δ (dimensionless).
    """

    name = "inertia"
    family = "load"
    equations = ("joint",)
    source = "10.1109/37.833638"
    parameters = (Parameter("deviation", "-", -0.8, 5.0, 0.1, "relative deviation of the inertia"),)
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed inertia."""
        return {"inertia": values["inertia"] * (1.0 + self.deviation)}

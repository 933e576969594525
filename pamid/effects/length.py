"""A muscle longer or shorter than its drawing."""

from __future__ import annotations

from collections.abc import Mapping

from .base import Effect
from .values import Parameter


class Length(Effect):
    r"""A muscle longer or shorter than its drawing. L₀ → L₀ (1 + δ).

    Parameters
    ----------
    **values : float
        ``deviation`` δ (dimensionless).
    """

    name = "length"
    family = "geometry"
    equations = ("force", "flow")
    source = "10.1109/70.481753"
    parameters = (Parameter("deviation", "-", -0.5, 1.0, 0.1, "relative deviation of the rest length"),)
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed rest length."""
        return {"rest_length": values["rest_length"] * (1.0 + self.deviation)}

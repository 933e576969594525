"""A muscle thicker or thinner than its drawing."""

from __future__ import annotations

from collections.abc import Mapping

from .base import Effect
from .values import Parameter


class Diameter(Effect):
    r"""A muscle thicker or thinner than its drawing. D₀ → D₀ (1 + δ).

    Parameters
    ----------
    **values : float
        ``deviation`` δ (dimensionless).
    """

    name = "diameter"
    family = "geometry"
    equations = ("force", "flow")
    source = "10.1109/70.481753"
    parameters = (Parameter("deviation", "-", -0.5, 1.0, 0.1, "relative deviation of the rest diameter"),)
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed rest diameter."""
        return {"rest_diameter": values["rest_diameter"] * (1.0 + self.deviation)}

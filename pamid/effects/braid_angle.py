"""A braid wound at another angle."""

from __future__ import annotations

from collections.abc import Mapping

from .base import Effect
from .values import Parameter


class BraidAngle(Effect):
    r"""A braid wound at another angle. θ₀ → θ₀ (1 + δ).

    Parameters
    ----------
    **values : float
        ``deviation`` δ (dimensionless).
    """

    name = "braid_angle"
    family = "geometry"
    equations = ("force", "flow")
    source = "10.1109/70.481753"
    parameters = (Parameter("deviation", "-", -0.3, 0.3, 0.1, "relative deviation of the braid angle"),)
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed braid angle."""
        return {"braid_angle": values["braid_angle"] * (1.0 + self.deviation)}

"""A valve larger or smaller than its data sheet says."""

from __future__ import annotations

from collections.abc import Mapping

from .base import Effect
from .values import Parameter


class ValveConductance(Effect):
    r"""Another sonic conductance: C → C (1 + δ).

    Parameters
    ----------
    **values : float
        ``deviation`` δ (dimensionless).
    """

    name = "valve_conductance"
    family = "valve"
    equations = ("valve",)
    source = "ISO 6358-1:2013"
    parameters = (Parameter("deviation", "-", -0.9, 2.0, 0.15, "relative deviation", linear=True),)
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed conductance."""
        return {"sonic_conductance": values["sonic_conductance"] * (1.0 + self.deviation)}

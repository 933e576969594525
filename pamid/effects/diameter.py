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

    References
    ----------
    C.-P. Chou, B. Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles", IEEE Transactions
    on Robotics and Automation 12(1), 1996. https://doi.org/10.1109/70.481753

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("diameter", deviation=0.1)
    diameter(deviation=0.1)
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

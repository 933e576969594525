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

    References
    ----------
    C.-P. Chou, B. Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles", IEEE Transactions
    on Robotics and Automation 12(1), 1996. https://doi.org/10.1109/70.481753

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("braid_angle", deviation=0.1)
    braid_angle(deviation=0.1)
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

"""Friction in proportion to the speed."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class ViscousFriction(Effect):
    r"""Friction in proportion to the rate of contraction.

    .. math:: \Delta F = -c\,\dot x

    References
    ----------
    D. B. Reynolds et al., "Modeling the dynamic characteristics of pneumatic muscle", Annals of Biomedical
    Engineering 31, 2003. https://doi.org/10.1114/1.1554921
    """

    name = "viscous_friction"
    family = "friction"
    equations = ("force",)
    roles = ("velocity",)
    source = "10.1114/1.1554921"
    parameters = (Parameter("coefficient", "N s", 0.0, 1e5, 60.0, "force per speed", linear=True, position=-1),)
    coefficient: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −c ẋ, N."""
        return -self.coefficient * s.velocity

"""Ends of the muscle that do not stay cylindrical."""

from __future__ import annotations

from ..signals.state import Array
from .base import Effect, Parameter, Signals
from .plant import Plant


class EndCap(Effect):
    r"""Conical ends, which make the active part contract more than the whole.

    .. math:: \Delta F = \frac{p}{L_0}\left(\left.\frac{\partial V}{\partial\varepsilon}\right|_{k\varepsilon} -
        \left.\frac{\partial V}{\partial\varepsilon}\right|_{\varepsilon}\right)

    Parameters
    ----------
    **values : float
        ``factor`` k (dimensionless).

    References
    ----------
    B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE Control Systems
    Magazine 20(2), 2000. https://doi.org/10.1109/37.833638

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("end_cap", factor=1.1)
    end_cap(factor=1.1)
    """

    name = "end_cap"
    family = "elasticity"
    equations = ("force",)
    roles = ("position", "pressure")
    source = "10.1109/37.833638"
    parameters = (Parameter("factor", "-", 1.0, 1.6, 1.1, "contraction of the active part over that of the whole"),)
    factor: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force at the contraction k ε less that at ε, N."""
        change = plant.volume_slope(self.factor * s.position) - plant.volume_slope(s.position)
        return (s.pressure - plant.atmospheric_pressure) * change / plant.rest_length

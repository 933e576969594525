"""Heat loss to the surroundings."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter

REFERENCE = 300.0
"""Temperature, K, at which the slope of the loss is stated."""


class HeatLoss(Effect):
    r"""Heat loss at a port in kelvin: conduction (exponent 1), radiation (4), free convection in between.

    .. math:: \dot T = -h\,\frac{T_r}{n}\Big[\Big(\frac{T}{T_r}\Big)^n - \Big(\frac{T_a}{T_r}\Big)^n\Big]

    above the temperature Tₐ of the surroundings, with Tᵣ = 300 K: n = 1 for conduction and fans, 4 for radiation.

    Parameters
    ----------
    **values : float
        ``coefficient`` h, loss per kelvin at 300 K (kg/(s Pa), in the unit of the rate at a port), ``exponent`` n
        (dimensionless), ``ambient`` Tₐ (K).

    References
    ----------
    S. W. Churchill, H. H. S. Chu, "Correlating equations for laminar and turbulent free convection from a vertical
    plate", International Journal of Heat and Mass Transfer 18(11), 1975.
    https://doi.org/10.1016/0017-9310(75)90243-4
    """

    name = "heat_loss"
    family = "gas"
    equations = ("flow",)
    roles = ("pressure",)
    kinds = ()  # at temperatures alone
    domain = "temperature"
    source = "10.1016/0017-9310(75)90243-4"
    parameters = (
        Parameter("coefficient", "kg/(s Pa)", 0.0, 1e-3, 1e-7, "loss per kelvin at 300 K", linear=True),
        Parameter("exponent", "-", 1.0, 4.0, 4.0, "power of the absolute temperature"),
        Parameter("ambient", "K", 230.0, 350.0, 293.15, "temperature of the surroundings"),
    )
    coefficient: float
    exponent: float
    ambient: float

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the loss above the surroundings' temperature."""
        n = self.exponent
        above = np.maximum(s.pressure / REFERENCE, 0.0) ** n - (self.ambient / REFERENCE) ** n
        return FlowTerm(-self.coefficient * REFERENCE / n * np.maximum(above, 0.0), 0.0)

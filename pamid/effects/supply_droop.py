"""A supply whose pressure falls when it is drawn from."""

from __future__ import annotations

import numpy as np

from ..laws.valve import flow_function
from ..signals.state import Array
from .base import Effect, Parameter, Signals
from .plant import Plant


class SupplyDroop(Effect):
    r"""Resistance between regulator and valve: the inlet pressure falls with the flow drawn.

    .. math:: P_s' = P_s - R_s\,\dot m \approx \frac{P_s}{1 + R_s\, C\, u^+ \rho_0\, \psi(P/P_s)}

    Parameters
    ----------
    **values : float
        ``resistance`` R_s (Pa s/kg).

    References
    ----------
    ISO 6358-1:2013, "Pneumatic fluid power - Determination of flow-rate characteristics of components using
    compressible fluids".

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("supply_droop", resistance=2e+07)
    supply_droop(resistance=2e+07 Pa s/kg)
    """

    name = "supply_droop"
    family = "valve"
    equations = ("valve",)
    roles = ("command", "pressure")
    source = "ISO 6358-1:2013"
    parameters = (Parameter("resistance", "Pa s/kg", 0.0, 1e10, 2e7, "pressure lost per flow drawn"),)
    resistance: float

    def supply(self, P_supply: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the pressure at the inlet, Pa."""
        psi = flow_function(s.pressure / P_supply, plant.critical_pressure_ratio)
        drawn = plant.sonic_conductance * plant.reference_density * np.maximum(s.command, 0.0) * psi
        return P_supply / (1.0 + self.resistance * drawn)

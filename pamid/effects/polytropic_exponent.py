"""A polytropic exponent other than the nominal one."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class PolytropicExponent(Effect):
    r"""Compression between isothermal (exponent 1) and adiabatic (1.4 for air).

    .. math:: \Delta\dot m = \frac{\dot P\,V}{R T}\left(\frac{1}{n_P} - \frac{1}{\gamma}\right), \qquad
        n_P = \gamma - (\gamma - n)\,(1 + \sigma\,\mathrm{sgn}\,\dot P)

    Filling and venting exchange heat differently: their exponents differ where σ is not 0.

    Parameters
    ----------
    **values : float
        ``exponent`` n, ``skew`` σ (both dimensionless).
    """

    name = "polytropic_exponent"
    family = "gas"
    equations = ("flow",)
    roles = ("position", "pressure_rate")
    source = "10.1115/1.1286336"
    parameters = (
        Parameter("exponent", "-", 1.0, 1.4, 1.2, "exponent of the compression"),
        Parameter("skew", "-", -0.5, 0.5, 0.0, "by how much it is further from adiabatic while the pressure rises"),
    )
    exponent: float
    skew: float

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return (0, V/(R T) (1/n − 1/γ))."""
        adiabatic = plant.heat_capacity_ratio
        exponent = adiabatic - (adiabatic - self.exponent) * (1.0 + self.skew * np.sign(s.pressure_rate))
        return FlowTerm(0.0, plant.volume(s.position) / plant.RT * (1.0 / exponent - 1.0 / adiabatic))

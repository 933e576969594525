"""Leaks: through an orifice to the surroundings, through a gap or pipe between two chambers."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..laws.valve import flow_function
from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import parameter


class Leakage(Effect):
    r"""Flow out of the muscle into the surroundings through a small orifice.

    .. math:: \Delta\dot m = C_\ell\,\rho_0\,P\,\psi(P_\mathrm{atm}/P)
    """

    name = "leakage"
    family = "gas"
    roles = ("pressure",)
    source = "ISO 6358-1:2013"
    conductance = parameter("m^3/(s Pa)", 0.0, 1e-7, 1e-10, "sonic conductance of the leak", linear=True)

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow that leaks, kg/s."""
        psi = flow_function(plant.atmospheric_pressure / s.pressure, plant.critical_pressure_ratio)
        return FlowTerm(self.conductance * plant.reference_density * s.pressure * psi, 0.0)


class PortLeakage(Leakage):
    r"""Loss of what is stored: through a narrow gap or a resistance in proportion to it, through a hole to its root.

    .. math:: \dot x = -C\,\mathrm{sgn}(x)\,x_1\,|x / x_1|^n

    with n = 1 through a narrow gap or a resistance, 1/2 through a hole, and one unit of the port for :math:`x_1`; of a
    pressure above that of the surroundings with their :math:`\psi` of `Leakage`, and of a mass flow with its density.

    References
    ----------
    F. M. White, "Fluid Mechanics", 7th ed., McGraw-Hill, 2011, sections 3.5 (Torricelli) and 6.4 (laminar flow).
    """

    exponent = parameter("-", 0.4, 1.0, 1.0, "1 through a narrow gap or a resistance, 1/2 through a hole")
    unit_size: ClassVar[float] = 1.0
    """Size of one unit of the port, Pa."""
    of_mass: ClassVar[bool] = False
    """Whether what leaks is a mass of gas."""

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return what leaks: nothing from where nothing is."""
        there = np.where(s.pressure == 0.0, self.unit_size, s.pressure)
        a, b = super().flow(s.with_(pressure=there), x, plant)
        size = 1.0 if self.exponent == 1.0 else np.abs(there / self.unit_size) ** (self.exponent - 1.0)
        density = 1.0 if self.of_mass else plant.reference_density
        return FlowTerm(a / density * size * (s.pressure / there), b)


class Passage(Effect):
    r"""A gap or pipe with a flow proportional to the pressure difference: :math:`q = G\,(P_1 - P_2)`.

    References
    ----------
    H. E. Merritt, "Hydraulic Control Systems", Wiley, 1967, section 3.2 (leakage through clearances).
    """

    family = "gas"
    roles = ("pressure",)
    source = "Merritt, Hydraulic Control Systems, 1967"
    conductance = parameter("kg/(s Pa)", 0.0, 1e-3, 1e-9, "flow per difference", linear=True)

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow."""
        return FlowTerm(-self.conductance * s.pressure, 0.0)

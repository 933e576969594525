"""Leaks: through an orifice to the surroundings, through a gap or pipe between two chambers."""

from __future__ import annotations

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
    equations = ("flow",)
    roles = ("pressure",)
    source = "ISO 6358-1:2013"
    conductance = parameter("m^3/(s Pa)", 0.0, 1e-7, 1e-10, "sonic conductance of the leak", linear=True)

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow that leaks, kg/s."""
        psi = flow_function(plant.atmospheric_pressure / s.pressure, plant.critical_pressure_ratio)
        return FlowTerm(self.conductance * plant.reference_density * s.pressure * psi, 0.0)


class Passage(Effect):
    r"""A gap or pipe with a flow proportional to the pressure difference: :math:`q = G\,(P_1 - P_2)`.

    References
    ----------
    H. E. Merritt, "Hydraulic Control Systems", Wiley, 1967, section 3.2 (leakage through clearances).
    """

    family = "gas"
    equations = ()
    roles = ("pressure",)
    source = "Merritt, Hydraulic Control Systems, 1967"
    conductance = parameter("kg/(s Pa)", 0.0, 1e-3, 1e-9, "flow per difference", linear=True)

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow."""
        return FlowTerm(-self.conductance * s.pressure, 0.0)

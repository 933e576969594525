"""A muscle that leaks."""

from __future__ import annotations

from ..laws.valve import flow_function
from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class Leakage(Effect):
    r"""Flow out of the muscle into the surroundings through a small orifice.

    .. math:: \Delta\dot m = C_\ell\,\rho_0\,P\,\psi(P_\mathrm{atm}/P)
    """

    name = "leakage"
    family = "gas"
    equations = ("flow",)
    roles = ("pressure",)
    source = "ISO 6358-1:2013"
    parameters = (
        Parameter("conductance", "m^3/(s Pa)", 0.0, 1e-7, 1e-10, "sonic conductance of the leak", linear=True),
    )
    conductance: float

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow that leaks, kg/s."""
        psi = flow_function(plant.atmospheric_pressure / s.pressure, plant.critical_pressure_ratio)
        return FlowTerm(self.conductance * plant.reference_density * s.pressure * psi, 0.0)

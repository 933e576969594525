"""Gas flow into a chamber of changing volume, the law of `ThermodynamicPIHM`."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from ..constants import GAS_CONSTANT, HEAT_CAPACITY_RATIO, TEMPERATURE
from ..explained import explained_fields
from ..signals.state import State
from .base import Coefficients, Law


@explained_fields
@dataclass(frozen=True)
class ThermodynamicFlow(Law):
    r"""Mass flow into a muscle from the first law of thermodynamics.

    .. math:: \dot m = \frac{\dot P V}{\gamma R T} + \frac{P \dot V}{R T}, \qquad
        \dot V = \frac{\partial V}{\partial\varepsilon}\dot\varepsilon + \frac{\partial V}{\partial P}\dot P

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.laws.thermodynamic import ThermodynamicFlow
    >>> from pamid.signals import State
    >>> a = ThermodynamicFlow().coefficients(State(eps=0.1, deps=0.0, P=3e5, dP=1e5))
    >>> print(f"{a.V * 7e-5:.3g} kg/s into a muscle of 70 cm³ whose pressure rises by 1 bar/s")
    5.95e-05 kg/s into a muscle of 70 cm³ whose pressure rises by 1 bar/s
    """

    heat_capacity_ratio: Annotated[float, "γ, dimensionless; 1 is an isothermal chamber."] = HEAT_CAPACITY_RATIO
    gas_constant: Annotated[float, "R, J/(kg K)."] = GAS_CONSTANT
    temperature: Annotated[float, "T, K."] = TEMPERATURE

    equation: ClassVar[str] = "flow"
    target: ClassVar[str] = "mdot"
    unit: ClassVar[str] = "kg/s"

    def coefficients(self, state: State) -> Coefficients:
        """Return (Ṗ/(γRT), P ε̇/(RT), P Ṗ/(RT)); the pressure is absolute."""
        RT = self.gas_constant * self.temperature
        return Coefficients(
            state.dP / (self.heat_capacity_ratio * RT), state.P * state.deps / RT, state.P * state.dP / RT
        )

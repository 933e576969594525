"""Flow into an isothermal muscle. Copy to ``pamid/laws/my_law.py`` and change the coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..constants import GAS_CONSTANT, TEMPERATURE
from ..signals.state import State
from .base import Coefficients, Law


@dataclass(frozen=True)
class MyLaw(Law):
    r"""Rate of the mass of gas at one temperature.

    .. math:: \dot m = \frac{\dot P V + P\,(V_\varepsilon\,\dot\varepsilon + V_P\,\dot P)}{R\,T}

    Parameters
    ----------
    gas_constant : float, default=287
        R, J/(kg K).
    temperature : float, default=293
        T, K.
    """

    gas_constant: float = GAS_CONSTANT
    temperature: float = TEMPERATURE

    equation: ClassVar[str] = "flow"
    target: ClassVar[str] = "mdot"
    unit: ClassVar[str] = "kg/s"

    def coefficients(self, state: State) -> Coefficients:
        """Return the factors of V, ∂V/∂ε and ∂V/∂P."""
        heat = self.gas_constant * self.temperature
        return Coefficients(state.dP / heat, state.P * state.deps / heat, state.P * state.dP / heat)

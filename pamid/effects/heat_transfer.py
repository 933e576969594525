"""Heat that the gas gives to the walls."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import relax, relax_along
from .base import Effect, Parameter, Signals, Step
from .plant import Plant


class HeatTransfer(Effect):
    r"""Gas that warms when compressed and cools at the walls: adiabatic when fast, isothermal when slow.

    .. math:: \Delta\dot m = \frac{P V}{R T^2}\,\frac{\theta}{\tau}, \qquad
        \dot\theta = \frac{\gamma - 1}{\gamma}\,T\,\frac{\dot P}{P} - \frac{\theta}{\tau}

    with the excess temperature θ of the gas and the time constant τ of its cooling at constant pressure, for small θ.
    As θ = h − x with h = (γ − 1)/γ T ln P and τ ẋ = h − x, the memory is a first-order lag.

    Parameters
    ----------
    **values : float
        ``time_constant`` τ (s).

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("heat_transfer", time_constant=0.2)
    heat_transfer(time_constant=0.2 s)
    """

    name = "heat_transfer"
    family = "gas"
    equations = ("flow",)
    roles = ("position", "pressure")
    source = "10.1115/1.1286336"
    n_states = 1
    parameters = (Parameter("time_constant", "s", 1e-3, 1e4, 0.2, "time constant of the cooling"),)
    time_constant: float

    def _adiabatic(self, s: Signals, plant: Plant) -> Array:
        """Return the temperature that an adiabatic compression would give, up to a constant, K."""
        g = plant.heat_capacity_ratio
        return (g - 1.0) / g * plant.temperature * np.log(s.pressure / plant.atmospheric_pressure)

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return gas at the temperature of the walls."""
        return self._adiabatic(s, plant)[None]

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Cool towards the walls."""
        return relax(x, self._adiabatic(s0, plant), self._adiabatic(s1, plant), dt, self.time_constant)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the lag along each trajectory, without a loop over time."""
        return relax_along(self._adiabatic(s, plant), dt, self.time_constant, starts)[None]

    def flow(self, s: Signals, x: Array, plant: Plant) -> Step:
        """Return the extra gas that the cooling makes room for, kg/s."""
        theta = self._adiabatic(s, plant) - x[0]
        room = s.pressure * plant.volume(s.position) / (plant.RT * plant.temperature)
        return Step(room * theta / self.time_constant, 0.0)

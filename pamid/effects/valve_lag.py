"""A spool that needs time to move."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import hold_along
from .base import Effect, Parameter, Signals
from .plant import Plant


class ValveLag(Effect):
    r"""First-order lag of the spool behind the command, which is held over a control period.

    .. math:: \tau\,\dot x = u - x, \qquad u' = x

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
    >>> make_effect("valve_lag", time_constant=0.01)
    valve_lag(time_constant=0.01 s)
    """

    name = "valve_lag"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    n_states = 1
    parameters = (Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of the spool"),)
    time_constant: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a spool at its command."""
        return np.array(s.command, dtype=float)[None]

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the command that is held from the first instant on."""
        return s0.command + (x - s0.command) * np.exp(-dt / self.time_constant)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the spool's position along each trajectory, without a loop over time."""
        return hold_along(s.command, dt, self.time_constant, starts)[None]

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the spool's position."""
        return x[0]

"""A spool that needs time to move."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import hold_along
from ._second_order import carried, carried_along
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter

_LEAST = 1e-4
"""Inertia below which a spool counts as massless: its second time constant is that small a share of the first."""


class ValveLag(Effect):
    r"""Lag of the spool behind the command; second order if the spool has inertia.

    .. math:: s\,\tau^2\,\ddot y + \tau\,\dot y = u - y, \qquad u' = y

    The command is held for a control period. With s = 0 it is a lag of first order, with s = 1/4 two alike
    concatenated; above that the spool swings about its command, with a damping ratio of :math:`1/(2\sqrt{s})`. By τ it
    comes late in any case.

    Parameters
    ----------
    **values : float
        ``time_constant`` τ (s), ``second`` s (dimensionless).
    """

    name = "valve_lag"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    n_states = 2
    parameters = (
        Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of what follows the command"),
        Parameter("second", "-", 0.0, 1.0, 0.0, "inertia: 0.25 for two lags alike, above it swings"),
    )
    time_constant: float
    second: float

    def _spring(self) -> tuple[float, float]:
        """Return natural frequency (rad/s) and damping ratio."""
        root = float(np.sqrt(self.second))
        return 1.0 / (self.time_constant * root), 0.5 / root

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a spool at rest at its command: its position and its speed."""
        u = np.array(s.command, dtype=float)
        return np.stack([u, 0.0 * u])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the command that is held from the first instant on."""
        u = s0.command
        if self.second < _LEAST:
            return np.stack([u + (x[0] - u) * np.exp(-dt / self.time_constant), 0.0 * x[0]])
        return carried(x, u, u, *self._spring(), dt, ramp=False)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the spool's position and speed along each run, without a loop over time."""
        if self.second < _LEAST:
            y = hold_along(s.command, dt, self.time_constant, starts)
            return np.stack([y, 0.0 * y])
        return carried_along(s.command, dt, *self._spring(), starts, ramp=False)

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the spool's position."""
        return x[0]

"""A spool that needs time to move."""

from __future__ import annotations

import numpy as np

from ..signals.recursion import recursive
from ..signals.state import Array
from ._memory import hold_along
from .base import Effect, Parameter, Signals
from .plant import Plant

_UNLIKE = 0.999
"""Most that the second lag is as a share of the first: of two alike the difference is a derivative."""


class ValveLag(Effect):
    r"""Lag of the spool behind the command, which is held over a control period; of second order with a second lag.

    .. math:: \tau_1\,\dot x = u - x, \qquad \tau_2\,\dot y = x - y, \qquad u' = y, \qquad
        \tau_1 + \tau_2 = \tau, \qquad \tau_2 = s\,\tau_1

    Parameters
    ----------
    **values : float
        ``time_constant`` τ (s), ``second`` s (dimensionless): 0 for a lag of first order, 1 for two alike.

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("valve_lag", time_constant=0.01)
    valve_lag(time_constant=0.01 s, second=0)
    """

    name = "valve_lag"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    n_states = 2
    parameters = (
        Parameter("time_constant", "s", 1e-4, 0.5, 0.01, "time constant of the spool"),
        Parameter("second", "-", 0.0, 1.0, 0.0, "second lag as a share of the first"),
    )
    time_constant: float
    second: float

    def _lags(self) -> tuple[float, float]:
        share = min(self.second, _UNLIKE)
        first = self.time_constant / (1.0 + share)
        return first, share * first

    def _decays(self, dt: float) -> tuple[float, float, float]:
        """Return what is left of either lag after an interval, and what the first one leaves in the second."""
        first, second = self._lags()
        e1 = float(np.exp(-dt / first))
        if second <= 0.0:
            return e1, 0.0, e1
        e2 = float(np.exp(-dt / second))
        return e1, e2, first / (first - second) * (e1 - e2)

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a spool at its command."""
        u = np.array(s.command, dtype=float)
        return np.stack([u, u])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the command that is held from the first instant on."""
        e1, e2, cross = self._decays(dt)
        u = s0.command
        return np.stack([u + (x[0] - u) * e1, u + (x[0] - u) * cross + (x[1] - u) * e2])

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the spool's position along each trajectory, without a loop over time."""
        u = np.asarray(s.command, dtype=float)
        x = hold_along(u, dt, self._lags()[0], starts)
        if self.second <= 0.0:
            return np.stack([x, x])
        _, e2, cross = self._decays(dt)
        drive = np.empty_like(u)
        drive[1:] = (cross * x + (1.0 - cross - e2) * u)[:-1]
        drive[starts] = u[starts]
        y = recursive(drive, [e2], starts)
        return np.stack([x, y])

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the spool's position."""
        return x[1]

"""A compliant shaft, belt or rod between drive and load."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._second_order import carried, carried_along
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class Compliance(Effect):
    r"""Spring and damper between drive and load: the transmitted force oscillates at their natural frequency.

    .. math:: \ddot F' = \omega^2\,(F - F') - 2\,\zeta\,\omega\,\dot F'

    Parameters
    ----------
    **values : float
        ``frequency`` ω (rad/s), ``damping`` ζ (dimensionless).
    """

    name = "compliance"
    family = "drive"
    equations = ("force", "joint")
    roles = ("force",)
    channel = "F"
    kinds = ("actuator", "joint", "motor")
    prior = -2.0  # a stiff drive is the simpler model
    source = "10.1115/1.3143860"
    n_states = 2
    sampled = True
    parameters = (
        Parameter("frequency", "rad/s", 3.0, 3e3, 60.0, "natural frequency of drive and load"),
        Parameter("damping", "-", 0.02, 0.5**0.5, 0.2, "damping ratio; above its bound nothing swings: that is a lag"),
    )
    frequency: float
    damping: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a spring at rest under the load."""
        F = np.array(s.force, dtype=float)
        return np.stack([F, np.zeros_like(F)])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Oscillate about the load."""
        return carried(x, s0.force, s1.force, self.frequency, self.damping, dt, ramp=True)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the transmitted force and its rate along each run, without a loop over time."""
        return carried_along(s.force, dt, self.frequency, self.damping, starts, ramp=True)

    def measure(self, value: Array, x: Array) -> Array:
        """Return the force of the spring, N."""
        return x[0]

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the load from the transmitted force; noise of the reading is amplified by about 1/(ω dt)²."""
        out = np.array(reading, dtype=float)
        ends = [*list(starts)[1:], len(out)]
        for a, b in zip(starts, ends, strict=True):
            if b - a > 2:
                rate = np.gradient(out[a:b], dt, axis=0)
                bend = np.gradient(rate, dt, axis=0)
                out[a:b] += 2.0 * self.damping / self.frequency * rate + bend / self.frequency**2
        return out

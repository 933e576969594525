"""A spring with a mass behind it: in the drive, or beside the load."""

from __future__ import annotations

import math

import numpy as np

from ..signals.state import Array
from ._memory import carried, carried_along, unlagged
from ._places import OfForce
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class Compliance(OfForce):
    r"""Spring and damper between drive and load: the transmitted force oscillates at their natural frequency.

    .. math:: \ddot F' = \omega^2\,(F - F') - 2\,\zeta\,\omega\,\dot F'
    """

    name = "compliance"
    family = "drive"
    kinds = ("actuator", "joint", "motor")
    prior = -2.0  # a stiff drive is the simpler model
    source = "10.1115/1.3143860"
    n_states = 2
    sampled = True
    frequency = parameter("rad/s", 3.0, 3e3, 60.0, "natural frequency of drive and load", symbol="ω")
    damping = parameter(
        "-", 0.02, 0.5**0.5, 0.2, "damping ratio; above its bound nothing swings: that is a lag", symbol="ζ"
    )

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

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the load from the transmitted force; noise of the reading is amplified by about 1/(ω dt)²."""
        return unlagged(reading, dt, 2.0 * self.damping / self.frequency, self.frequency**-2, starts)


class Resonance(Effect):
    r"""A load, a rotor or a frame on a spring and a damper.

    .. math:: \Delta F = -m\,\ddot y, \qquad
        \ddot y = \omega^2\,(x - y) + 2\,\zeta\,\omega\,(\dot x - \dot y)

    Far below its frequency it acts as an added mass. It begins at rest relative to its carrier.
    """

    name = "resonance"
    family = "load"
    roles = ("position", "velocity")
    kinds = ("actuator", "joint", "motor")
    prior = -2.0  # a rigid body is the simpler model
    source = "10.1115/1.3143860"
    n_states = 2
    mass = parameter("N s^2", 0.0, 1e6, 0.1, "mass on the spring", linear=True, position=-1, symbol="m")
    frequency = parameter("rad/s", 3.0, 3e3, 60.0, "natural frequency of that mass alone", points=8, symbol="ω")
    damping = parameter("-", 0.005, 0.99, 0.1, "damping ratio of that mass alone", points=2, symbol="ζ")

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a mass that moves with its carrier."""
        return np.stack([s.position + 0.0, s.velocity + 0.0])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Oscillate freely about a carrier in uniform motion."""
        fades, damper = self.damping * self.frequency, 2.0 * self.damping * self.frequency
        swings = self.frequency * math.sqrt(1.0 - self.damping**2)
        speed = (s1.position - s0.position) / dt
        ahead = x[0] - s0.position
        gains = x[1] - damper * ahead - speed
        decay, sine, cosine = np.exp(-fades * dt), np.sin(swings * dt), np.sin(swings * dt + 0.5 * math.pi)
        later = decay * (ahead * cosine + (gains + fades * ahead) / swings * sine)
        gained = decay * (gains * cosine - (self.frequency**2 * ahead + fades * gains) / swings * sine)
        return np.stack([later + s1.position, gained + speed + damper * later])

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the mass along each run, without a loop over time."""
        speed = np.asarray(s.velocity, dtype=float)
        return carried_along(s.position, dt, self.frequency, self.damping, starts, ramp=True, speed=speed)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the reaction of spring and damper, N."""
        damper, behind = 2.0 * self.damping * self.frequency, s.position - x[0]
        pulls = self.frequency**2 * behind + damper * (s.velocity - x[1] - damper * behind)
        return -self.mass * pulls

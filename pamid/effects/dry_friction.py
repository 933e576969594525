"""Dry friction: bristles that turn over within a displacement, and how much they resist."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from ..signals.paths import Path
from ..signals.state import Array
from ._memory import dahl, drawn_along
from .base import Effect, Signals
from .plant import Plant
from .values import parameter

PRESLIDING = parameter("-", 1e-6, 2e-3, 2e-4, "displacement within which friction turns over", position=1, symbol="δ")
TRANSITION = parameter(
    "1/s", 0.0, 0.1, 0.0, "speed below which friction fades, as tanh", position=1, refines=True, symbol="v_t"
)


class _Bristles(Effect):
    """Dry friction that turns over within a displacement, by Dahl's bristles."""

    family = "friction"
    n_states = 1
    path_dependent = holds = True
    presliding: float
    exponent: float = 1.0
    transition: float = 0.0

    @property
    def turns_within(self) -> float:
        """The presliding displacement."""
        return self.presliding

    def sharp(self) -> Self:
        """Return it with the least presliding displacement, over which it turns gradually, and without a transition."""
        plain = {"presliding": PRESLIDING.lower, "exponent": 1.0, "transition": 0.0}
        return self.unchecked(**{name: v for name, v in plain.items() if name in self.values})

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return bristles at zero deflection."""
        return np.zeros((1, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Bend the bristles by the displacement between the two instants."""
        return dahl(x, s1.position - s0.position, self.presliding, self.exponent)

    def trace_along(self, path: Path, plant: Plant, dt: float) -> Array:
        """Return the bristles along a path; where they bend exponentially, without a loop over its turns."""
        if self.exponent <= 0.999:
            return super().trace_along(path, plant, dt)
        turns = path.turns
        d = np.diff(turns.values, axis=0) / self.presliding
        at_turns = drawn_along(np.copysign(1.0, d), np.exp(-np.abs(d)), np.zeros(1, dtype=int))
        held = at_turns.ravel()[turns.last][None]
        return self.step(held, Signals(position=turns.before), Signals(position=path.position), dt, plant)

    @staticmethod
    def pressing(s: Signals, plant: Plant) -> Array:
        """Return the gauge pressure that presses on what rubs, Pa, never below 0."""
        return np.maximum(s.pressure - plant.atmospheric_pressure, 0.0)

    def turned(self, s: Signals, x: Array) -> Array:
        """Return the direction of friction, from -1 to 1; it fades where a motion is slow."""
        return x[0] * np.tanh(np.abs(s.velocity) / self.transition) if self.transition else x[0]


class CoulombFriction(_Bristles):
    r"""Dry friction against the motion, independent of speed, regularised by presliding.

    .. math:: \Delta F = -(F_c + \mu\,(P - P_\mathrm{atm}))\, z \tanh\frac{|\dot x|}{v_t}, \qquad
        \frac{\mathrm{d}z}{\mathrm{d}x} = \frac{1}{\delta}\left(1 - z\,\mathrm{sgn}\,\dot x\right)^n

    with Dahl's bristle z, which turns over within a few presliding displacements δ after a reversal: gradually (n = 1),
    or linearly until it slides, like an elastic–plastic asperity (n = 0). The threads' share grows with the pressure
    that presses them onto each other; 0 by default. Below the transition speed v_t friction fades, as simulators smooth
    its sign; 0, the default, is without that.

    References
    ----------
    P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976.
    https://doi.org/10.2514/3.61511

    S. Andersson, A. Söderberg, S. Björklund, "Friction models for sliding dry, boundary and mixed lubricated contacts",
    Tribology International 40(4), 2007. https://doi.org/10.1016/j.triboint.2005.11.014
    """

    name = "coulomb_friction"
    roles = ("position", "velocity", "pressure")
    source = "10.2514/3.61511"
    amplitude = parameter("N", 0.0, 1e4, 4.0, "sliding friction", linear=True, symbol="F_c")
    per_pressure = parameter("N/Pa", 0.0, 1e-2, 0.0, "sliding friction per gauge pressure", linear=True, symbol="μ")
    presliding = replace(PRESLIDING, essential=True)
    exponent = parameter("-", 0.0, 1.0, 1.0, "1: gradual (Dahl), 0: elastic until it slides", symbol="n")
    transition = TRANSITION

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −(F_c + μ p) z, N."""
        level = self.amplitude
        if self.per_pressure:
            level = level + self.per_pressure * self.pressing(s, plant)
        return -level * self.turned(s, x)


class LoadDependentFriction(_Bristles):
    r"""Dry friction in proportion to the gauge pressure, which presses the threads onto each other.

    .. math:: \Delta F = -\mu\,(P - P_\mathrm{atm})\, z

    with the direction z of the motion as in `CoulombFriction`.
    """

    name = "load_dependent_friction"
    roles = ("position", "velocity", "pressure")
    prior = -6.0  # one of the common effects is nearly always equivalent
    source = "10.1109/37.833638"
    coefficient = parameter("N/Pa", 0.0, 1e-2, 2e-5, "sliding friction per gauge pressure", linear=True, symbol="μ")
    presliding = replace(PRESLIDING, essential=True)
    transition = TRANSITION

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −μ p z, N, never below zero load."""
        return -self.coefficient * self.pressing(s, plant) * self.turned(s, x)


class DirectionalFriction(_Bristles):
    r"""Dry friction of a seal, lip or gear: different forwards and backwards, and changing with pressure.

    .. math:: \Delta F = -(F_+ + \mu_+\,p)\,\max(z, 0) - (F_- + \mu_-\,p)\,\min(z, 0)

    with the gauge pressure p and the direction z of the motion as in `CoulombFriction`. Pressure that lifts a
    lip lowers its friction.
    """

    name = "directional_friction"
    roles = ("position", "velocity", "pressure")
    extends = "coulomb_friction"
    kinds = ("actuator", "joint", "motor")
    prior = -4.0  # friction alike in both directions is the simpler one
    source = "10.1016/0005-1098(94)90209-7"
    forward = parameter("N", 0.0, 1e4, 4.0, "sliding friction while the position grows", linear=True, symbol="F₊")
    backward = parameter(
        "N", 0.0, 1e4, 2.0, "sliding friction while it falls", linear=True, unlike="forward", symbol="F₋"
    )
    forward_per_pressure = parameter(
        "N/Pa", -1e-2, 1e-2, 0.0, "the first one's change by pressure", linear=True, symbol="μ₊"
    )
    backward_per_pressure = parameter(
        "N/Pa", -1e-2, 1e-2, 0.0, "the other one's change", linear=True, unlike="forward_per_pressure", symbol="μ₋"
    )
    presliding = PRESLIDING
    transition = TRANSITION

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the friction of the direction in which the bristles are bent, N."""
        z, forward, backward = self.turned(s, x), self.forward, self.backward
        if self.forward_per_pressure or self.backward_per_pressure:
            p = self.pressing(s, plant)
            forward, backward = forward + self.forward_per_pressure * p, backward + self.backward_per_pressure * p
        return -forward * np.maximum(z, 0.0) - backward * np.minimum(z, 0.0)


class StribeckFriction(_Bristles):
    r"""Dry friction whose breakaway part fades with speed.

    .. math:: \Delta F = -\left(F_c + F_s\, e^{-(\dot x / v_s)^2}\right) z

    with the direction z of the motion, which turns over within the presliding displacement and fades below the
    transition speed as in `CoulombFriction`.
    """

    name = "stribeck_friction"
    roles = ("position", "velocity")
    extends = "coulomb_friction"
    prior = -4.0  # friction alike at every speed is the simpler one
    source = "10.1016/0005-1098(94)90209-7"
    coulomb = parameter("N", 0.0, 1e4, 3.0, "friction at speed", linear=True, essential=True, symbol="F_c")
    breakaway = parameter("N", 0.0, 1e4, 3.0, "excess at rest", linear=True, essential=True, symbol="F_s")
    velocity = parameter("1/s", 1e-4, 10.0, 0.02, "speed at which the excess fades", position=1, symbol="v_s")
    presliding = PRESLIDING
    transition = TRANSITION

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the friction, N."""
        return -(self.coulomb + self.breakaway * np.exp(-((s.velocity / self.velocity) ** 2))) * self.turned(s, x)


class TorqueLoss(_Bristles):
    r"""Share of the transmitted force that is lost; a different share where the load drives the motor.

    .. math:: \Delta F = -\eta\,|F|\,z, \qquad \eta = \eta_d \text{ where } F z > 0, \text{ else } \eta_b

    with the transmitted force F and the direction z of the motion as in `CoulombFriction`.

    References
    ----------
    G. Passault, M. Duclusaud, "Extended friction models for the physics simulation of servo actuators",
    arXiv:2410.08650, 2024. https://doi.org/10.48550/arXiv.2410.08650
    """

    name = "torque_loss"
    roles = ("position", "velocity", "pressure", "force")
    kinds = ("joint", "motor")
    source = "10.48550/arXiv.2410.08650"
    driving = parameter("-", 0.0, 1.0, 0.1, "share lost while the motor moves the load", linear=True, symbol="η_d")
    driven = parameter("-", 0.0, 1.0, 0.05, "share lost while the load moves the motor", linear=True, symbol="η_b")
    presliding = PRESLIDING
    transition = TRANSITION

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the loss, N."""
        load = s.force
        if isinstance(plant, Plant):  # a muscle transmits its own tension
            load = (s.pressure - plant.atmospheric_pressure) * plant.volume_slope(s.position) / plant.rest_length
        z = self.turned(s, x)
        return -np.where(load * z > 0.0, self.driving, self.driven) * np.abs(load) * z

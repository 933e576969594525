"""Lost motion: what follows only once a play is used up."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..signals.paths import play
from ..signals.state import Array
from ._places import OfCommand, OfForce, OnSignal
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import parameter


class _LostMotion(OnSignal):
    """What follows a signal once the play is used up."""

    family = "hysteresis"
    source = "10.1016/S0005-1098(02)00047-X"
    n_states = 1
    sampled = True
    half_width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the middle of the play."""
        return np.stack([self.signal(s) + 0.0])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Drag along where the play is used up."""
        now = self.signal(s1)
        return np.clip(x, now - self.half_width, now + self.half_width)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the dragged position along each run, without a loop over time."""
        return play(np.asarray(self.signal(s), dtype=float), self.half_width, starts)[None]


class Backlash(_LostMotion):
    r"""Lost motion between joint and muscle: after a reversal the muscle does not move until the play is used up.

    .. math:: y = \mathrm{play}_w(\varepsilon), \qquad
        \Delta F = \frac{P - P_\mathrm{atm}}{L_0}\,\big(V'(y) - V'(\varepsilon)\big), \qquad
        \Delta\dot m = \frac{\dot P\,(V(y) - V(\varepsilon))}{\gamma R T} +
        \frac{P\,(V'(y)\,\dot y - V'(\varepsilon)\,\dot\varepsilon)}{R T}
    """

    name = "backlash"
    roles = ("position", "velocity", "pressure")
    of = "position"
    prior = -6.0  # rare on a bench whose muscles pull against each other
    sampled = False
    path_dependent = True
    least_difference = 1e-9  # the driven side is engaged where it stands at an end of the play, up to rounding
    half_width = parameter("-", 0.0, 0.1, 2e-3, "half the play", position=1, symbol="w")

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the tension at the driven side's contraction less that at the joint's, N."""
        slope = plant.volume_slope(x[0]) - plant.volume_slope(s.position)
        return (s.pressure - plant.atmospheric_pressure) / plant.rest_length * slope

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow of the driven side's volume less that of the joint's."""
        y = x[0]
        lost = s.position - y
        engaged = (np.abs(lost) >= (1.0 - self.least_difference) * self.half_width) & (lost * s.velocity >= 0.0)
        rate = plant.volume_slope(y) * np.where(engaged, s.velocity, 0.0) - plant.volume_slope(s.position) * s.velocity
        room = plant.volume(y) - plant.volume(s.position)
        return FlowTerm(s.pressure * rate / plant.RT, room / (plant.heat_capacity_ratio * plant.RT))


class ActuatorBacklash(_LostMotion, OfCommand):
    r"""Lost motion in a gear or linkage of the actuator.

    .. math:: u' = \mathrm{play}_w(u)
    """

    name = "actuator_backlash"
    kinds = ("motor",)
    half_width = parameter("-", 0.0, 0.5, 0.03, "half the play", symbol="w")


class OutputBacklash(_LostMotion, OfForce):
    r"""Lost motion behind a drive: after a reversal its output stays constant until the play is used up.

    .. math:: y' = \mathrm{play}_w(y)

    This is a gear's play, or a position controller of low gain k against dry friction :math:`F_c`, for which w is
    :math:`F_c / k`: the joint sticks until the control error overcomes the friction. Each run begins at its first
    reading.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.effects import make_effect
    >>> from pamid.effects.base import Signals
    >>> lost = make_effect("output_backlash", half_width=0.5)
    >>> lost.trace(Signals(force=np.array([0.0, 2.0, 1.5, 0.0])), None, 0.01, np.array([0]))[0]
    array([0. , 1.5, 1.5, 0.5])
    """

    name = "output_backlash"
    equations = ("joint",)
    kinds = ("joint", "motor")
    prior = -4.0  # friction at the joint is equivalent for a drive that pushes with a force
    half_width = parameter("N", 0.0, 1e3, 1.0, "half the play", symbol="w")


class Play(Effect):
    r"""Lost motion of the spring (and damper) between two ends, which transmits nothing within the play.

    .. math:: f = k\,\operatorname{clip}(\delta, -w, w) + d\,\dot\delta\,[\,|\delta| < w\,]

    in addition to the simulator's own coupling, :math:`-k \delta - d \dot\delta`: together the spring behind the play.
    Its stiffness k and damping d are those of the simulator. A share ``damped`` of the damper acts within the play.

    References
    ----------
    M. Nordin, P.-O. Gutman, "Controlling mechanical systems with backlash: a survey", Automatica 38(10), 2002.
    https://doi.org/10.1016/S0005-1098(02)00047-X
    """

    family = "hysteresis"
    roles = ("position", "velocity")
    source = "10.1016/S0005-1098(02)00047-X"
    half_width = parameter("-", 0.0, 0.1, 0.01, "half the play", position=1, essential=True)
    damped = parameter("-", 0.0, 1.0, 0.0, "share of the damping that acts within the play")
    stiffness: ClassVar[float] = 1.0
    """Of the simulator's coupling, in the library's units."""
    damping: ClassVar[float] = 0.0

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force that the coupling does not transmit within the play."""
        free = (1.0 - self.damped) * self.damping * s.velocity
        within = np.abs(s.position) < self.half_width
        return self.stiffness * np.clip(s.position, -self.half_width, self.half_width) + np.where(within, free, 0.0)

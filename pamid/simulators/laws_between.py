"""Laws that act only between two ports: play, spring, passage."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..effects import Effect, Parameter, Signals
from ..effects.base import FlowTerm
from ..effects.plant import Plant
from ..signals.state import Array


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
    equations = ()
    roles = ("position", "velocity")
    source = "10.1016/S0005-1098(02)00047-X"
    parameters = (
        Parameter("half_width", "-", 0.0, 0.1, 0.01, "half the play", position=1, essential=True),
        Parameter("damped", "-", 0.0, 1.0, 0.0, "share of the damping that acts within the play"),
    )
    half_width: float
    damped: float
    stiffness: ClassVar[float] = 1.0
    """Of the simulator's coupling, in the library's units."""
    damping: ClassVar[float] = 0.0

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force that the coupling does not transmit within the play."""
        free = (1.0 - self.damped) * self.damping * s.velocity
        within = np.abs(s.position) < self.half_width
        return self.stiffness * np.clip(s.position, -self.half_width, self.half_width) + np.where(within, free, 0.0)


class Spring(Effect):
    r"""A spring between two ends that are free in the simulator: :math:`f = -k\,(\delta - \delta_0)`."""

    family = "elasticity"
    equations = ()
    roles = ("position",)
    source = "10.1007/978-1-4899-7560-7"
    parameters = (
        Parameter("stiffness", "N", 0.0, 1e6, 100.0, "force per travel", linear=True, position=-1),
        Parameter("preload", "N", -1e4, 1e4, 0.0, "force at zero travel", linear=True),
    )
    stiffness: float
    preload: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k δ + F₀."""
        return self.preload - self.stiffness * s.position


class Passage(Effect):
    r"""A gap or pipe with a flow proportional to the pressure difference: :math:`q = G\,(P_1 - P_2)`.

    References
    ----------
    H. E. Merritt, "Hydraulic Control Systems", Wiley, 1967, section 3.2 (leakage through clearances).
    """

    family = "gas"
    equations = ()
    roles = ("pressure",)
    source = "Merritt, Hydraulic Control Systems, 1967"
    parameters = (Parameter("conductance", "kg/(s Pa)", 0.0, 1e-3, 1e-9, "flow per difference", linear=True),)
    conductance: float

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow."""
        return FlowTerm(-self.conductance * s.pressure, 0.0)


LAWS: dict[str, type[Effect]] = {"backlash": Play, "spring": Spring}
"""Effects that act only between two ports, by name."""
ONE_BODY = ("load", "drive")
"""Families of effects of a load on one end, or of its drive: they make no sense between two."""

"""What acts at all times alike: a weight, a preload, a wind; an inflow; a source of heat."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class SteadyForce(Effect):
    r"""A force that never changes, such as a weight, a preload or a wind: :math:`\Delta F = F_0`."""

    family = "load"
    roles = ("velocity",)
    source = "10.1007/978-1-4899-7560-7"
    size = parameter("N", -1e3, 1e3, 1.0, "force in the direction of the position", linear=True)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return F₀."""
        return np.full(np.shape(s.velocity), self.size)


class SteadyInflow(Effect):
    r"""What flows into a store at all times alike, or out of it: :math:`\Delta\dot m = \dot m_0`."""

    family = "load"
    roles = ("pressure",)
    source = "10.1007/978-1-4899-7560-7"
    size = parameter("N", -1e3, 1e3, 1e-4, "inflow", linear=True)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the inflow."""
        return np.full(np.shape(s.pressure), self.size)


class SteadyHeating(SteadyInflow):
    r"""A source of heat that never changes: :math:`\Delta\dot T = \dot T_0`."""

    domain = "temperature"

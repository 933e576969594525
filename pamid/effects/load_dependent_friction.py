"""Dry friction that grows with the pressure."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import dahl
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class LoadDependentFriction(Effect):
    r"""Dry friction in proportion to the gauge pressure, which presses the threads onto each other.

    .. math:: \Delta F = -\mu\,(P - P_\mathrm{atm})\, z

    with Dahl's bristle z as in `CoulombFriction`.

    Parameters
    ----------
    **values : float
        ``coefficient`` μ (N/Pa), ``presliding`` δ (unit of the position).
    """

    name = "load_dependent_friction"
    family = "friction"
    equations = ("force",)
    roles = ("position", "pressure")
    prior = -6.0  # one of the common effects is nearly always equivalent
    source = "10.1109/37.833638"
    n_states = 1
    path_dependent = True
    parameters = (
        Parameter("coefficient", "N/Pa", 0.0, 1e-2, 2e-5, "sliding friction per gauge pressure", linear=True),
        Parameter(
            "presliding",
            "-",
            1e-6,
            2e-3,
            2e-4,
            "displacement within which friction turns over",
            essential=True,
            position=1,
        ),
    )
    coefficient: float
    presliding: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return bristles at zero deflection."""
        return np.zeros((1, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Bend the bristles by the displacement between the two instants."""
        return dahl(x, s1.position - s0.position, self.presliding)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −μ p z, N, never below zero load."""
        return -self.coefficient * np.maximum(s.pressure - plant.atmospheric_pressure, 0.0) * x[0]

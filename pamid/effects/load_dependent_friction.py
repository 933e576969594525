"""Dry friction that grows with the pressure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..signals.state import Array
from ._laws import PRESLIDING, TRANSITION, Bristles
from .base import Signals
from .plant import Plant
from .values import Parameter


class LoadDependentFriction(Bristles):
    r"""Dry friction in proportion to the gauge pressure, which presses the threads onto each other.

    .. math:: \Delta F = -\mu\,(P - P_\mathrm{atm})\, z

    with the direction z of the motion as in `CoulombFriction`.

    Parameters
    ----------
    **values : float
        ``coefficient`` μ (N/Pa), ``presliding`` δ (unit of the position), ``transition`` v_t (unit of the
        position per s).
    """

    name = "load_dependent_friction"
    roles = ("position", "velocity", "pressure")
    prior = -6.0  # one of the common effects is nearly always equivalent
    source = "10.1109/37.833638"
    parameters = (
        Parameter("coefficient", "N/Pa", 0.0, 1e-2, 2e-5, "sliding friction per gauge pressure", linear=True),
        replace(PRESLIDING, essential=True),
        TRANSITION,
    )
    coefficient: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −μ p z, N, never below zero load."""
        return -self.coefficient * np.maximum(s.pressure - plant.atmospheric_pressure, 0.0) * self.turned(s, x)

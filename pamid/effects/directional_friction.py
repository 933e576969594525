"""Dry friction that differs by the direction of the motion."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._laws import PRESLIDING, TRANSITION, Bristles
from .base import Signals
from .plant import Plant
from .values import Parameter


class DirectionalFriction(Bristles):
    r"""Dry friction of a seal, a lip or a gear that differs forwards and backwards, and changes with pressure.

    .. math:: \Delta F = -(F_+ + \mu_+\,p)\,\max(z, 0) - (F_- + \mu_-\,p)\,\min(z, 0)

    with the gauge pressure p and the direction z of the motion as in `CoulombFriction`. Pressure that lifts a
    lip lowers its friction.

    Parameters
    ----------
    **values : float
        ``forward`` F₊ and ``backward`` F₋ (N), ``forward_per_pressure`` μ₊ and ``backward_per_pressure`` μ₋ (N/Pa),
        ``presliding`` δ (unit of the position), ``transition`` v_t (unit of the position per s).
    """

    name = "directional_friction"
    roles = ("position", "velocity", "pressure")
    extends = "coulomb_friction"
    kinds = ("actuator", "joint", "motor")
    prior = -4.0  # friction alike in both directions is the simpler one
    source = "10.1016/0005-1098(94)90209-7"
    parameters = (
        Parameter("forward", "N", 0.0, 1e4, 4.0, "sliding friction while the position grows", linear=True),
        Parameter("backward", "N", 0.0, 1e4, 2.0, "sliding friction while it falls", linear=True, unlike="forward"),
        Parameter("forward_per_pressure", "N/Pa", -1e-2, 1e-2, 0.0, "the first one's change by pressure", linear=True),
        Parameter(
            "backward_per_pressure",
            "N/Pa",
            -1e-2,
            1e-2,
            0.0,
            "the other one's change",
            linear=True,
            unlike="forward_per_pressure",
        ),
        PRESLIDING,
        TRANSITION,
    )
    forward: float
    backward: float
    forward_per_pressure: float
    backward_per_pressure: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the friction of the direction in which the bristles are bent, N."""
        z, forward, backward = self.turned(s, x), self.forward, self.backward
        if self.forward_per_pressure or self.backward_per_pressure:
            p = np.maximum(s.pressure - plant.atmospheric_pressure, 0.0)
            forward, backward = forward + self.forward_per_pressure * p, backward + self.backward_per_pressure * p
        return -forward * np.maximum(z, 0.0) - backward * np.minimum(z, 0.0)

"""Loss of a gear or a tendon in proportion to what it transmits."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._laws import PRESLIDING, TRANSITION, Bristles
from .base import Signals
from .plant import Plant
from .values import Parameter


class TorqueLoss(Bristles):
    r"""Share of the transmitted force that is lost; a different share where the load drives the motor.

    .. math:: \Delta F = -\eta\,|F|\,z, \qquad \eta = \eta_d \text{ where } F z > 0, \text{ else } \eta_b

    with the transmitted force F and the direction z of the motion as in `CoulombFriction`.

    Parameters
    ----------
    **values : float
        ``driving`` η_d and ``driven`` η_b (dimensionless), ``presliding`` δ (unit of the position),
        ``transition`` v_t (unit of the position per s).

    References
    ----------
    G. Passault, M. Duclusaud, "Extended friction models for the physics simulation of servo actuators",
    arXiv:2410.08650, 2024. https://doi.org/10.48550/arXiv.2410.08650
    """

    name = "torque_loss"
    roles = ("position", "velocity", "pressure", "force")
    kinds = ("joint", "motor")
    source = "10.48550/arXiv.2410.08650"
    parameters = (
        Parameter("driving", "-", 0.0, 1.0, 0.1, "share lost while the motor moves the load", linear=True),
        Parameter("driven", "-", 0.0, 1.0, 0.05, "share lost while the load moves the motor", linear=True),
        PRESLIDING,
        TRANSITION,
    )
    driving: float
    driven: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the loss, N."""
        load = s.force
        if isinstance(plant, Plant):  # a muscle transmits its own tension
            load = (s.pressure - plant.atmospheric_pressure) * plant.volume_slope(s.position) / plant.rest_length
        z = self.turned(s, x)
        return -np.where(load * z > 0.0, self.driving, self.driven) * np.abs(load) * z

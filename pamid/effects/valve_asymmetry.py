"""A valve that vents more or less than it fills."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Parameter, Signals
from .plant import Plant


class ValveAsymmetry(Effect):
    r"""Ports of different size: the vent passes (1 + α) times what the nominal valve passes.

    .. math:: u' = u\ (u \ge 0), \qquad u' = (1 + \alpha)\,u\ (u < 0)

    Parameters
    ----------
    **values : float
        ``asymmetry`` α (dimensionless).

    References
    ----------
    ISO 6358-1:2013, "Pneumatic fluid power - Determination of flow-rate characteristics of components using
    compressible fluids".
    """

    name = "valve_asymmetry"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "ISO 6358-1:2013"
    parameters = (Parameter("asymmetry", "-", -0.9, 2.0, 0.2, "excess conductance of the vent", linear=True),)
    asymmetry: float

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command, enlarged where it vents."""
        return u + self.asymmetry * np.minimum(u, 0.0)

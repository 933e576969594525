"""A valve that vents more or less than it fills."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class ValveAsymmetry(Effect):
    r"""Ports of different size: the vent passes more than the inlet.

    .. math:: u' = (1 - \sigma\alpha)\,u\ (u \ge 0), \qquad u' = (1 + (1 - \sigma)\,\alpha)\,u\ (u < 0)

    With σ = 0 the nominal conductance is that of the inlet, with σ = 1/2 the mean of both.

    Parameters
    ----------
    **values : float
        ``asymmetry`` α, ``split`` σ (both dimensionless).
    """

    name = "valve_asymmetry"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "ISO 6358-1:2013"
    parameters = (
        Parameter("asymmetry", "-", -0.9, 0.9, 0.2, "gain of negative commands less that of others", linear=True),
        Parameter("split", "-", 0.0, 1.0, 0.0, "share of it that positive commands lack"),
    )
    asymmetry: float
    split: float

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command, enlarged where it vents and reduced where it fills."""
        part = self.split * self.asymmetry
        return u + (self.asymmetry - part) * np.minimum(u, 0.0) - part * np.maximum(u, 0.0)

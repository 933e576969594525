"""A quantised reading."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect
from .values import Parameter


class Quantisation(Effect):
    r"""A reading in fixed steps.

    .. math:: y' = d\,\mathrm{round}(y / d)

    References
    ----------
    B. Widrow, I. Kollár, "Quantization Noise", Cambridge University Press, 2008.
    https://doi.org/10.1017/CBO9780511754661
    """

    name = "quantisation"
    family = "sensor"
    equations = ("force", "joint")
    roles = ("force",)
    channel = "F"
    kinds = ("actuator", "joint", "motor", "muscle")
    prior = -6.0  # it leaves noise rather than a gap, unless its steps are large
    source = "10.1017/CBO9780511754661"
    parameters = (Parameter("resolution", "N", 1e-4, 1e3, 1.0, "step of the reading"),)
    resolution: float

    def measure(self, value: Array, x: Array) -> Array:
        """Return the nearest step."""
        return self.resolution * np.round(np.asarray(value) / self.resolution)

"""A valve that does not open fully."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class ValveSaturation(Effect):
    r"""A stop before full opening.

    .. math:: u' = \max(-u_s, \min(u_s, u))

    Parameters
    ----------
    **values : float
        ``limit`` u_s (dimensionless).

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("valve_saturation", limit=0.5)
    valve_saturation(limit=0.5)
    """

    name = "valve_saturation"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    parameters = (Parameter("limit", "-", 0.02, 1.0, 0.5, "largest opening", idle=True),)
    limit: float

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command within ±u_s."""
        return np.clip(u, -self.limit, self.limit)

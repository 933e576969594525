"""A valve that stays shut around its middle."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Parameter, Signals
from .plant import Plant


class ValveDeadZone(Effect):
    r"""Overlap of the spool: small commands open nothing, larger ones less than they should.

    .. math:: u' = \mathrm{sgn}(u)\,\max(|u| - d,\, 0)\,\Big(1 + \frac{\kappa\, d}{1 - d}\Big)

    With κ = 1 a full command still opens the valve fully, with κ = 0 it opens it by d less.

    Parameters
    ----------
    **values : float
        ``width`` d, ``stretch`` κ (both dimensionless).

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> make_effect("valve_dead_zone", width=0.04)
    valve_dead_zone(width=0.04, stretch=0)
    """

    name = "valve_dead_zone"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    parameters = (
        Parameter("width", "-", 0.0, 0.5, 0.04, "command below which the valve is shut"),
        Parameter("stretch", "-", 0.0, 1.0, 0.0, "share of the lost travel that larger commands make up for"),
    )
    width: float
    stretch: float

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command less the dead zone."""
        steeper = 1.0 + self.stretch * self.width / (1.0 - self.width)
        return (u - np.clip(u, -self.width, self.width)) * steeper

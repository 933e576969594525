"""A valve that stays shut around its middle."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class ValveDeadZone(Effect):
    r"""Overlap of the spool: small commands open nothing, larger ones less than they should.

    .. math:: u' = \mathrm{sgn}(u)\,\max(|u| - d_u,\, 0)\,\Big(1 + \frac{\kappa\, d_u}{1 - d_u}\Big), \qquad
        d_u = d\,(1 + \sigma\, \mathrm{sgn}\, u)

    With κ = 1 a full command still opens the valve fully, with κ = 0 it opens it by d less. Overlaps may differ for
    filling and venting (σ), and ports open gradually: within ρ d_u about the edge a parabola takes the corner's place.

    Parameters
    ----------
    **values : float
        ``width`` d, ``stretch`` κ, ``skew`` σ, ``rounding`` ρ (all dimensionless).
    """

    name = "valve_dead_zone"
    family = "valve"
    equations = ("valve",)
    roles = ("command",)
    source = "10.1115/1.1286336"
    parameters = (
        Parameter("width", "-", 0.0, 0.5, 0.04, "size of the command up to which nothing responds"),
        Parameter("stretch", "-", 0.0, 1.0, 0.0, "share of the lost travel that larger commands make up for"),
        Parameter("skew", "-", -0.9, 0.9, 0.0, "by how much the zone is wider for positive commands than on the mean"),
        Parameter("rounding", "-", 0.0, 1.0, 0.0, "half width of the round edges, as a share of the zone"),
    )
    width: float
    stretch: float
    skew: float
    rounding: float

    def command(self, u: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the command less the dead zone."""
        width = self.width * (1.0 + self.skew * np.sign(u))
        steeper = 1.0 + self.stretch * width / (1.0 - width)
        past, edge = np.abs(u) - width, np.maximum(self.rounding * width, 1e-12)
        opened = np.where(np.abs(past) < edge, np.square(past + edge) / (4.0 * edge), np.maximum(past, 0.0))
        return np.sign(u) * opened * steeper

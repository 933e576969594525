"""A tank that overflows."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import Parameter


class Overflow(Effect):
    r"""Outflow above a level, as from an overflowing tank or an opening relief valve.

    .. math:: \Delta\dot m = -c\,\max(P - P_o, 0)

    Parameters
    ----------
    **values : float
        ``coefficient`` c (kg/(s Pa)), ``level`` P_o (Pa, or the unit of the head).

    References
    ----------
    M. Schoukens, J. P. Noël, "Three benchmarks addressing open challenges in nonlinear system identification",
    IFAC-PapersOnLine 50(1), 2017. https://doi.org/10.1016/j.ifacol.2017.08.071
    """

    name = "overflow"
    family = "gas"
    equations = ("flow",)
    roles = ("pressure",)
    kinds = ("gas",)
    source = "10.1016/j.ifacol.2017.08.071"
    parameters = (
        Parameter("coefficient", "kg/(s Pa)", 0.0, 1e-3, 1e-8, "outflow per pressure above the level", linear=True),
        Parameter("level", "Pa", 2e2, 2e6, 3e5, "where it begins"),
    )
    coefficient: float
    level: float

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return −c (P − P_o) above the level, kg/s."""
        return FlowTerm(-self.coefficient * np.maximum(s.pressure - self.level, 0.0), 0.0)

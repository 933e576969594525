"""Hysteresis of the force in the pressure, at any speed of filling."""

from __future__ import annotations

from ..signals.state import Array
from ._laws import Stops
from ._stop import stops_force
from .base import Signals
from .plant import Plant
from .values import Parameter


class PressureHysteresis(Stops):
    r"""Prandtl–Ishlinskii operator in the pressure: braid and bladder resist both filling and venting.

    .. math:: \Delta F = -\sum_{i=1}^{3} (w_i + v_i\,\varepsilon)\,z_i, \qquad
        z_i = \frac{P - \mathrm{play}_{r_i}(P)}{r_i}, \qquad r_i = \tfrac{1}{3}\,r,\; r,\; 3\,r

    with elastic stops z in [−1, 1]. Their weights may change with the contraction.

    Parameters
    ----------
    **values : float
        ``narrow``, ``middle``, ``wide`` w (N), ``narrow_growth``, ``middle_growth``, ``wide_growth`` v (N per
        contraction), ``width`` r of the middle stop (Pa).

    References
    ----------
    T. Vo-Minh, T. Tjahjowidodo, H. Ramon, H. Van Brussel, "A new approach to modeling hysteresis in a pneumatic
    artificial muscle using the Maxwell-slip model", IEEE/ASME Transactions on Mechatronics 16(1), 2011.
    https://doi.org/10.1109/TMECH.2009.2038373
    """

    name = "pressure_hysteresis"
    equations = ("force",)
    of = "pressure"
    roles = ("position", "pressure")
    kinds = ("muscle",)
    source = "10.1109/TMECH.2009.2038373"
    parameters = (
        Parameter("narrow", "N", -1e3, 1e4, 0.0, "weight of the narrow stop", linear=True),
        Parameter("middle", "N", -1e3, 1e4, 5.0, "weight of the middle stop", linear=True),
        Parameter("wide", "N", -1e3, 1e4, 0.0, "weight of the wide stop", linear=True),
        Parameter("narrow_growth", "N", -1e5, 1e5, 0.0, "its growth per contraction", linear=True, position=-1),
        Parameter("middle_growth", "N", -1e5, 1e5, 0.0, "its growth per contraction", linear=True, position=-1),
        Parameter("wide_growth", "N", -1e5, 1e5, 0.0, "its growth per contraction", linear=True, position=-1),
        Parameter("width", "Pa", 1e4, 2e5, 1e5, "pressure over which the middle stop goes from one end to the middle"),
    )
    narrow: float
    middle: float
    wide: float
    narrow_growth: float
    middle_growth: float
    wide_growth: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the stops, N."""
        growths = (self.narrow_growth, self.middle_growth, self.wide_growth)
        return stops_force(x, (self.narrow, self.middle, self.wide), growths, s.position)

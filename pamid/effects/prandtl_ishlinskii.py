"""Rate-independent hysteresis in the command of a smart material."""

from __future__ import annotations

from ..signals.paths import Path
from ..signals.state import Array
from ._laws import Stops
from ._stop import stops_along, stops_force
from .base import Signals
from .plant import Plant
from .values import Parameter


class PrandtlIshlinskii(Stops):
    r"""Prandtl–Ishlinskii operator: elastic stops of three widths, whose weights may change with the position.

    .. math:: \Delta y = -\sum_{i=1}^{3} (w_i + v_i\,x)\,z_i, \qquad
        z_i = \frac{x - \mathrm{play}_{r_i}(x)}{r_i}, \qquad r_i = \tfrac{1}{3}\,r,\; r,\; 3\,r

    The position x of a piezo stage is the voltage that drives it.

    Parameters
    ----------
    **values : float
        ``narrow``, ``middle``, ``wide`` w (N), ``narrow_slope``, ``middle_slope``, ``wide_slope`` v (N per unit of
        the position), ``width`` r of the middle stop (unit of the position).
    """

    name = "prandtl_ishlinskii"
    equations = ("force",)
    of = "position"
    roles = ("position",)
    kinds = ("actuator",)
    prior = -2.0  # elements alike, or spread evenly, are the simpler model
    source = "10.3166/ejc.9.407-418"
    path_dependent = True
    parameters = (
        Parameter("narrow", "N", -1e3, 1e4, 2.0, "weight of the narrow stop", linear=True),
        Parameter("middle", "N", -1e3, 1e4, 2.0, "weight of the middle stop", linear=True),
        Parameter("wide", "N", -1e3, 1e4, 2.0, "weight of the wide stop", linear=True),
        Parameter("narrow_slope", "N", -1e4, 1e4, 0.0, "its change with the position", linear=True, position=-1),
        Parameter("middle_slope", "N", -1e4, 1e4, 0.0, "its change with the position", linear=True, position=-1),
        Parameter("wide_slope", "N", -1e4, 1e4, 0.0, "its change with the position", linear=True, position=-1),
        Parameter("width", "-", 3e-3, 0.035, 0.03, "displacement over which the middle stop turns over", position=1),
    )
    narrow: float
    middle: float
    wide: float
    narrow_slope: float
    middle_slope: float
    wide_slope: float

    def trace_along(self, path: Path, plant: Plant, dt: float) -> Array:
        """Return the stops along a path, without a loop over its turns."""
        return stops_along(path.position, self.width, path.starts)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the force of the stops, N."""
        slopes = (self.narrow_slope, self.middle_slope, self.wide_slope)
        return stops_force(x, (self.narrow, self.middle, self.wide), slopes, s.position)

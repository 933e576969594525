"""Rate-independent hysteresis in the command of a smart material."""

from __future__ import annotations

from ..signals.paths import Path
from ..signals.state import Array
from ._stop import RATIOS, stopped, stops_along, stops_at, stops_force
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class PrandtlIshlinskii(Effect):
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
    family = "hysteresis"
    equations = ("force",)
    roles = ("position",)
    kinds = ("actuator",)
    prior = -2.0  # elements alike, or spread evenly, are the simpler model
    source = "10.3166/ejc.9.407-418"
    n_states = len(RATIOS)
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
    width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return stops in the middle of their range."""
        return stops_at(s.position)

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move the stops by the displacement between the two instants."""
        return stopped(x, s1.position - s0.position, self.width)

    def trace_along(self, path: Path, plant: Plant, dt: float) -> Array:
        """Return the stops along a path, without a loop over its turns."""
        return stops_along(path.position, self.width, path.starts)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return what the stops hold back, N."""
        slopes = (self.narrow_slope, self.middle_slope, self.wide_slope)
        return stops_force(x, (self.narrow, self.middle, self.wide), slopes, s.position)

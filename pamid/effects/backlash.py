"""Play between muscle and joint."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Parameter, Signals
from .plant import Plant


class Backlash(Effect):
    r"""Play: after a reversal the driven side stands still until the play is used up.

    .. math:: y = \mathrm{play}_w(x), \qquad \Delta F = -k\,(x - y)

    with the play operator of half width w, |x − y| ≤ w: within the play the force has slope k, outside it stays.

    Parameters
    ----------
    **values : float
        ``half_width`` w (unit of the position), ``stiffness`` k (N per unit of the position).

    References
    ----------
    M. Brokate, J. Sprekels, "Hysteresis and Phase Transitions", Springer, 1996.
    https://doi.org/10.1007/978-1-4612-4048-8
    """

    name = "backlash"
    family = "hysteresis"
    equations = ("force",)
    roles = ("position",)
    source = "10.1007/978-1-4612-4048-8"
    n_states = 1
    path_dependent = True
    parameters = (
        Parameter("half_width", "-", 1e-5, 0.2, 2e-3, "half the play"),
        Parameter("stiffness", "N", 0.0, 1e7, 2e3, "slope within the play", linear=True),
    )
    half_width: float
    stiffness: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the middle of the play."""
        return np.array(s.position, dtype=float)[None]

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Drag the driven side along where the play is used up."""
        return np.clip(x, s1.position - self.half_width, s1.position + self.half_width)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k (x − y), N."""
        return -self.stiffness * (s.position - x[0])

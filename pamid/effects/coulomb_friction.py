"""Dry friction of the braid, with presliding."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from ._memory import dahl
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter


class CoulombFriction(Effect):
    r"""Dry friction against the motion, independent of speed, regularised by presliding.

    .. math:: \Delta F = -(F_c + \mu\,(P - P_\mathrm{atm}))\, z, \qquad \frac{\mathrm{d}z}{\mathrm{d}x} =
        \frac{1}{\delta}\left(1 - z\,\mathrm{sgn}\,\dot x\right)^n

    with Dahl's bristle z, which turns over within a few presliding displacements δ after a reversal: gradually (n = 1),
    or linearly until it slides, like an elastic–plastic asperity (n = 0). The threads' share grows with the pressure
    that presses them onto each other; 0 by default.

    Parameters
    ----------
    **values : float
        ``amplitude`` F_c (N), ``per_pressure`` μ (N/Pa), ``presliding`` δ (unit of the position),
        ``exponent`` n (dimensionless).

    References
    ----------
    P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976.
    https://doi.org/10.2514/3.61511
    """

    name = "coulomb_friction"
    family = "friction"
    equations = ("force",)
    roles = ("position", "pressure")
    source = "10.2514/3.61511"
    n_states = 1
    path_dependent = True
    parameters = (
        Parameter("amplitude", "N", 0.0, 1e4, 4.0, "sliding friction", linear=True),
        Parameter("per_pressure", "N/Pa", 0.0, 1e-2, 0.0, "sliding friction per gauge pressure", linear=True),
        Parameter(
            "presliding",
            "-",
            1e-6,
            2e-3,
            2e-4,
            "displacement within which friction turns over",
            essential=True,
            position=1,
        ),
        Parameter("exponent", "-", 0.0, 1.0, 1.0, "1: gradual (Dahl), 0: elastic until it slides"),
    )
    amplitude: float
    per_pressure: float
    presliding: float
    exponent: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return bristles at zero deflection."""
        return np.zeros((1, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Bend the bristles by the displacement between the two instants."""
        return dahl(x, s1.position - s0.position, self.presliding, self.exponent)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −(F_c + μ p) z, N."""
        level = self.amplitude
        if self.per_pressure:
            level = level + self.per_pressure * np.maximum(s.pressure - plant.atmospheric_pressure, 0.0)
        return -level * x[0]

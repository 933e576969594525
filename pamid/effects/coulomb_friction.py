"""Dry friction of the braid, with presliding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..signals.state import Array
from ._laws import PRESLIDING, TRANSITION, Bristles
from .base import Signals
from .plant import Plant
from .values import Parameter


class CoulombFriction(Bristles):
    r"""Dry friction against the motion, independent of speed, regularised by presliding.

    .. math:: \Delta F = -(F_c + \mu\,(P - P_\mathrm{atm}))\, z \tanh\frac{|\dot x|}{v_t}, \qquad
        \frac{\mathrm{d}z}{\mathrm{d}x} = \frac{1}{\delta}\left(1 - z\,\mathrm{sgn}\,\dot x\right)^n

    with Dahl's bristle z, which turns over within a few presliding displacements δ after a reversal: gradually (n = 1),
    or linearly until it slides, like an elastic–plastic asperity (n = 0). The threads' share grows with the pressure
    that presses them onto each other; 0 by default. Below the transition speed v_t friction fades, as simulators smooth
    its sign; 0, the default, is without that.

    Parameters
    ----------
    **values : float
        ``amplitude`` F_c (N), ``per_pressure`` μ (N/Pa), ``presliding`` δ (unit of the position),
        ``exponent`` n (dimensionless), ``transition`` v_t (unit of the position per s).

    References
    ----------
    P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976.
    https://doi.org/10.2514/3.61511

    S. Andersson, A. Söderberg, S. Björklund, "Friction models for sliding dry, boundary and mixed lubricated contacts",
    Tribology International 40(4), 2007. https://doi.org/10.1016/j.triboint.2005.11.014
    """

    name = "coulomb_friction"
    roles = ("position", "velocity", "pressure")
    source = "10.2514/3.61511"
    parameters = (
        Parameter("amplitude", "N", 0.0, 1e4, 4.0, "sliding friction", linear=True),
        Parameter("per_pressure", "N/Pa", 0.0, 1e-2, 0.0, "sliding friction per gauge pressure", linear=True),
        replace(PRESLIDING, essential=True),
        Parameter("exponent", "-", 0.0, 1.0, 1.0, "1: gradual (Dahl), 0: elastic until it slides"),
        TRANSITION,
    )
    amplitude: float
    per_pressure: float
    exponent: float

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −(F_c + μ p) z, N."""
        level = self.amplitude
        if self.per_pressure:
            level = level + self.per_pressure * np.maximum(s.pressure - plant.atmospheric_pressure, 0.0)
        return -level * self.turned(s, x)

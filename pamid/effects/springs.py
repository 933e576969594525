"""Elastic forces: of a bladder, of a spring that is not linear, of a stop."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class BladderElasticity(Effect):
    r"""Bladder that widens as the muscle contracts, which lowers the tension.

    .. math:: \Delta F = -k_1\,\varepsilon - k_3\,\varepsilon^3
    """

    name = "bladder_elasticity"
    family = "elasticity"
    roles = ("position",)
    source = "10.1115/1.482478"
    stiffness = parameter("N", 0.0, 1e5, 150.0, "force per contraction", linear=True, position=-1, symbol="k₁")
    cubic = parameter("N", 0.0, 1e6, 0.0, "force per cubed contraction", linear=True, position=-3, symbol="k₃")

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k₁ ε − k₃ ε³, N."""
        return -(self.stiffness + self.cubic * s.position**2) * s.position


class BladderPreload(Effect):
    r"""Force of a bladder that resists even at rest length, and more as the muscle contracts.

    .. math:: \Delta F = -(F_0 + k\,\varepsilon + c\,\varepsilon^2)

    A negative c is a rubber that softens with stretch.
    """

    name = "bladder_preload"
    family = "elasticity"
    roles = ("position",)
    kinds = ("muscle",)
    source = "10.1115/1.482478"
    rest = parameter("N", 0.0, 1e4, 30.0, "force at rest length", linear=True, symbol="F₀")
    growth = parameter("N", 0.0, 1e6, 500.0, "further force per contraction", linear=True, position=-1, symbol="k")
    curvature = parameter("N", -1e7, 1e7, 0.0, "the same per squared contraction", linear=True, position=-2, symbol="c")

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −(F₀ + k ε + c ε²), N."""
        return -(self.rest + (self.growth + self.curvature * s.position) * s.position)


class NonlinearStiffness(Effect):
    r"""Restoring force beyond Hooke's law, as in a Duffing oscillator.

    .. math:: \Delta F = -k_2\,x^2 - k_3\,x^3

    References
    ----------
    T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in nonlinear system
    identification", European Control Conference, 2013. https://doi.org/10.23919/ECC.2013.6669201
    """

    name = "nonlinear_stiffness"
    family = "elasticity"
    equations = ("force", "joint")
    roles = ("position",)
    kinds = ("joint", "motor")
    prior = -2.0  # a polynomial: what has a form of its own goes first
    source = "10.23919/ECC.2013.6669201"
    square = parameter("N", -1e6, 1e6, 0.0, "force per squared travel", linear=True, position=-2, symbol="k₂")
    cubic = parameter("N", -1e7, 1e7, 1e3, "force per cubed travel", linear=True, position=-3, symbol="k₃")

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k₂ x² − k₃ x³."""
        return -(self.square + self.cubic * s.position) * s.position**2


class Spring(Effect):
    r"""A spring that the simulator lacks, as of a cable, or between two ends: :math:`f = -k\,(\delta - \delta_0)`."""

    family = "elasticity"
    roles = ("position",)
    source = "10.1007/978-1-4899-7560-7"
    stiffness = parameter("N", 0.0, 1e6, 100.0, "force per travel", linear=True, essential=True, position=-1)
    preload = parameter("N", -1e4, 1e4, 0.0, "force at zero travel", linear=True)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k δ + F₀."""
        return self.preload - self.stiffness * s.position


_NEAR = 0.25
"""Usual place of a stop, as a share of half the travel from its end: what is pressed is short."""


class UpperStop(Effect):
    r"""A stop above which a spring and a damper act.

    .. math:: \Delta F = -k\,(x - x_s) - d\,\dot x \quad\text{where } x > x_s

    References
    ----------
    G. Gilardi, I. Sharf, "Literature survey of contact dynamics modelling", Mechanism and Machine Theory 37(10), 2002.
    https://doi.org/10.1016/S0094-114X(02)00045-9
    """

    family = "load"
    roles = ("position", "velocity")
    prior = -2.0  # most joints end their travel before a stop does
    source = "10.1016/S0094-114X(02)00045-9"
    stiffness = parameter(
        "N", 0.0, 1e7, 1e3, "force per travel beyond the stop", linear=True, essential=True, position=-1
    )
    damping = parameter("N s", 0.0, 1e6, 0.0, "force per speed there", linear=True, position=-1)
    limit = parameter("-", -10.0, 10.0, 0.1, "where it begins", position=1)
    side: ClassVar[float] = 1.0

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −k (x − x_s) − d v beyond the stop."""
        beyond = s.position - self.limit
        return np.where(self.side * beyond > 0.0, -self.stiffness * beyond - self.damping * s.velocity, 0.0)

    @classmethod
    def within(cls, low: float, high: float) -> type[Effect]:
        """Return the effect with its stop in that half of a travel which it ends."""
        middle, end = 0.5 * (high + low), high if cls.side > 0.0 else low
        limit = replace(
            cls.parameters[2], lower=min(middle, end), upper=max(middle, end), nominal=end + _NEAR * (middle - end),
            idle=cls.side > 0.0, idle_below=cls.side < 0.0,
        )  # fmt: skip
        return cls.narrowed(parameters=(*cls.parameters[:2], limit))


class LowerStop(UpperStop):
    r"""A stop below which a spring and a damper act.

    .. math:: \Delta F = -k\,(x - x_s) - d\,\dot x \quad\text{where } x < x_s
    """

    limit = replace(UpperStop.limit, nominal=0.12)
    side = -1.0

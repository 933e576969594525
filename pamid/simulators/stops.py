"""Stops at which a joint ends its travel: at ports alone, since where they are depends on the log."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..effects import Effect, Parameter, Signals
from ..effects.plant import Plant
from ..signals.state import Array
from .placement import narrowed

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
    equations = ()
    roles = ("position", "velocity")
    prior = -2.0  # most joints end their travel before a stop does
    source = "10.1016/S0094-114X(02)00045-9"
    parameters = (
        Parameter("stiffness", "N", 0.0, 1e7, 1e3, "force per travel beyond the stop", linear=True, position=-1),
        Parameter("damping", "N s", 0.0, 1e6, 0.0, "force per speed there", linear=True, position=-1),
        Parameter("limit", "-", -10.0, 10.0, 0.1, "where it begins", position=1),
    )
    stiffness: float
    damping: float
    limit: float
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
        return narrowed(cls, parameters=(*cls.parameters[:2], limit))


class LowerStop(UpperStop):
    r"""A stop below which a spring and a damper act.

    .. math:: \Delta F = -k\,(x - x_s) - d\,\dot x \quad\text{where } x < x_s
    """

    parameters = (*UpperStop.parameters[:2], replace(UpperStop.parameters[2], nominal=0.12))
    side = -1.0


STOPS: dict[str, type[UpperStop]] = {"upper_stop": UpperStop, "lower_stop": LowerStop}

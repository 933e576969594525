"""A muscle that cannot push."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect
from .values import Parameter


class Slack(Effect):
    r"""Slack muscle: the tension falls to zero, or to a residual tension once the muscle has buckled.

    .. math:: F' = F_0 + \tfrac{1}{2}\left(F - F_0 + \sqrt{(F - F_0)^2 + w^2}\right)

    Parameters
    ----------
    **values : float
        ``rounding`` w (N): force over which the muscle tightens; ``rest`` F₀ (N): tension of the loose muscle.

    Examples
    --------
    >>> from pamid.effects import make_effect
    >>> bool(make_effect("slack", rounding=20, rest=0).measure(-200.0, None) < 1)  # N: nothing is pushed
    True
    """

    name = "slack"
    family = "elasticity"
    equations = ("force", "joint")
    roles = ("force",)
    channel = "F"
    kinds = ("muscle",)
    source = "10.1109/37.833638"
    parameters = (
        Parameter("rounding", "N", 0.1, 200.0, 20.0, "force over which the muscle tightens"),
        Parameter("rest", "N", 0.0, 100.0, 5.0, "tension of the loose muscle"),
    )
    rounding: float
    rest: float

    def measure(self, value: Array, x: Array) -> Array:
        """Return the tension of a muscle that does not push, N."""
        over = value - self.rest
        return self.rest + 0.5 * (over + np.sqrt(np.square(over) + self.rounding**2))

    def restore(self, reading: Array, dt: float, starts: Array) -> Array:
        """Return the tension behind a reading; slack readings stay as they are."""
        over = np.asarray(reading, dtype=float) - self.rest
        true = over - self.rounding**2 / (4.0 * np.maximum(over, 1e-9))
        return self.rest + np.where(over > 0.25 * self.rounding, true, 0.0)

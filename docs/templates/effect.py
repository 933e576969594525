"""Drag with the square of the speed. Copy to ``pamid/effects/my_effect.py`` and change name, parameters and hook."""

from __future__ import annotations

import numpy as np

from ..signals.state import Array
from .base import Effect, Signals
from .plant import Plant
from .values import parameter


class MyEffect(Effect):
    r"""Drag with the square of the speed, :math:`\Delta F = -c\,|\dot\varepsilon|\,\dot\varepsilon`.

    Parameters
    ----------
    **values : float
        ``drag`` c (N s²).
    """

    name = "my_effect"
    family = "friction"
    equations = ("force",)
    roles = ("position", "velocity")
    source = "your source, a DOI if there is one"
    drag = parameter("N s²", 0.0, 1e4, 20.0, "force at a contraction of 1 in a second", linear=True)

    def force(self, s: Signals, x: Array, plant: Plant) -> Array:
        """Return −c |v| v, N."""
        return -self.drag * np.abs(s.velocity) * s.velocity

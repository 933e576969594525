"""Residuals that begin settled, add up, and keep their noise: what a simulator with ports answers about effects."""

from __future__ import annotations

import numpy as np

from ...effects import Parameter
from .protocol import Spec


class Settled:
    """Answers of a `pamid.gap.residuals.protocol.ResidualSource` whose noise and beginnings no effect changes."""

    def freedom(self, spec: Spec) -> float:
        """Return what it costs that the beginnings of runs are unknown: here they are taken as settled."""
        return 0.0

    def reach(self, spec: Spec) -> np.ndarray | None:
        """Return None: sensitivities about no effect hold beside any."""
        return None

    def reached(self, p: Parameter) -> Parameter:
        """Return a parameter within what the log reaches: here its own bounds."""
        return p

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return None: lags are put on the model, or undone in readings that are smoothed as before."""
        return None

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return None: no effect changes the noise."""
        return None

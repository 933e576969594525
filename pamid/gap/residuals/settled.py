"""Residuals with settled initial memory, superposition and constant noise, as those of a simulator with ports."""

from __future__ import annotations

import numpy as np

from ...effects import Parameter
from .protocol import Spec


class Settled:
    """Methods of a `pamid.gap.residuals.protocol.ResidualSource` whose noise and initial memory no effect changes."""

    def freedom(self, spec: Spec) -> float:
        """Return the price of unknown initial memory of runs: here it is taken as settled."""
        return 0.0

    def reach(self, spec: Spec) -> np.ndarray | None:
        """Return None: sensitivities about no effect also hold beside others."""
        return None

    def reached(self, p: Parameter) -> Parameter:
        """Return a parameter with bounds that the log reaches: here its own bounds."""
        return p

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return None: lags are applied to the model, or undone in readings that are smoothed as before."""
        return None

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return None: no effect changes the noise."""
        return None

    def filtered(self, spec: Spec, z: np.ndarray) -> np.ndarray | None:
        """Return None: no effect filters the noise."""
        return None

    def scales_noise(self, spec: Spec) -> bool:
        """Return False: no reading is undone."""
        return False

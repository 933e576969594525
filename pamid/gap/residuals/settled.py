"""What most residuals answer: settled initial memory, superposition, constant noise, a fixed integrator."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...effects import Parameter
from .protocol import Spec
from .whitening import Whitening


class Settled:
    """Methods of a `pamid.gap.residuals.protocol.ResidualSource` whose noise and initial memory no effect changes."""

    _whitening: Whitening

    def raw(self, z: np.ndarray) -> np.ndarray:
        """Return residuals, or changes of them, as the windows have them, in units of each window's noise."""
        return self._whitening.raw(z)

    def white(self, z: np.ndarray) -> np.ndarray:
        """Return residuals of the windows, or changes of them, with noise that is independent: the inverse of `raw`."""
        return self._whitening.white(z)

    def stepped(self) -> Self | None:
        """Return None: the integrator is that of the log."""
        return None

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

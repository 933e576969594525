"""Flow through a shut valve, which should be none. Copy to ``pamid/equations/my_residual.py``, change the residual."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .base import Equation, Residual, spread
from .run import Run
from .windows import kernel


class MyResidual(Equation):
    r"""Measured mass flow while the command is 0.

    .. math:: r = \dot m\,[u = 0]
    """

    name: ClassVar[str] = "my_residual"
    unit: ClassVar[str] = "kg/s"
    channels: ClassVar[tuple[str, ...]] = ("mdot", "u")
    order: ClassVar[int] = 1  # no time derivative
    rank: ClassVar[int] = 9

    def residual(self, run: Run) -> Residual:
        """Return the residual over windows, kg/s, and the standard deviation of its noise."""
        windows = run.windows(self)
        shut = (np.abs(run.u) < 1e-3).astype(float)
        measured, time = windows.mean(run.mdot), windows.time(run.time)
        value = windows.mean(shut * run.mdot)
        noise, _ = spread((windows.mean(shut), run.covariances(windows, "mdot", kernel(run.n, 1))), n_windows=len(time))
        return Residual(time, value, measured, noise)

"""The windows of one equation of a simulator with ports."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class PortWindows(NamedTuple):
    """The windows of one equation."""

    equation: str
    """Its name: the port that it tests."""
    unit: str
    """Unit of its residual."""
    first: np.ndarray
    """Rows of the log at which the windows begin."""
    centre: np.ndarray
    """Rows at their centres."""
    measured: np.ndarray
    """What was measured, in the equation's unit."""

"""The windows of one equation of a simulator with ports."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class PortWindows(NamedTuple):
    """The windows of one equation.

    Parameters
    ----------
    equation : str
        Its name: the port that it tests.
    unit : str
        Unit of its residual.
    first : array of int
        Rows of the log at which the windows begin.
    centre : array of int
        Rows at their centres.
    measured : array
        What was measured, in the equation's unit.
    """

    equation: str
    unit: str
    first: np.ndarray
    centre: np.ndarray
    measured: np.ndarray

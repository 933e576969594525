"""One equation of a simulator: a derivative of a channel against its modelled value."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Balance(NamedTuple):
    """One equation: a derivative of a channel against what the simulator says."""

    name: str
    """The port that it tests."""
    channel: str
    """What was measured."""
    order: int
    """Order of its derivative."""
    row: int
    """Row of the states' rates, or of the outputs where the order is 0."""
    unit: str
    """Its unit."""
    velocity: str = ""
    """The velocity that it holds against a position; empty for the simulator's own equations."""

    def rate(self, x: np.ndarray, dt: float) -> np.ndarray:
        """Return the derivative of a channel over one run, without smoothing."""
        return np.asarray(np.diff(x, self.order) / dt**self.order)

    def mean(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the same means of rates given at both ends of each step, linear between them."""
        if self.order == 1:
            return 0.5 * (start[:-1] + end[:-1])
        return (start[:-2] + 2.0 * end[:-2]) / 6.0 + (2.0 * start[1:-1] + end[1:-1]) / 6.0

"""Parameters along a log: the same in each row, or changed by effects from row to row."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...simulators.base import Simulator
from ...simulators.of_parameters import FIXED
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog


def wide(p: np.ndarray, n: int) -> np.ndarray:
    """Return parameters in each of n rows, shape (n_parameters, n)."""
    return p if p.ndim == 2 else np.repeat(p[:, None], n, axis=1)


def changed(p: np.ndarray, place: Placement, made: Any, simulator: Simulator, log: PortLog) -> np.ndarray:
    """Return parameters as an effect changes them."""
    if not isinstance(made, FIXED):  # otherwise no row has rates of its own
        p = wide(p, log.n)
    if p.ndim == 2:
        return place.adjusted(made, p, list(simulator.parameters), log.along, log.t)
    return place.adjusted(made, p, list(simulator.parameters))

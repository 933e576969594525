"""Parameters along a log: the same in each row, or changed by effects from row to row."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...simulators.of_parameters import FIXED
from ...simulators.port_log import PortLog


def wide(p: np.ndarray, n: int) -> np.ndarray:
    """Return parameters in each of n rows, shape (n_parameters, n)."""
    return p if p.ndim == 2 else np.repeat(p[:, None], n, axis=1)


def changed(p: np.ndarray, k: int, made: Any, log: PortLog) -> np.ndarray:
    """Return parameters with the k-th as an effect changes it."""
    if p.ndim == 1 and isinstance(made, FIXED):  # constant: no row has rates of its own
        out = p.copy()
        out[k] = made.adjust({"value": p[k]})["value"]
        return out
    out = wide(p, log.n).copy()
    out[k] = made.adjust({"value": out[k], "along": log.along})["value"]
    return out

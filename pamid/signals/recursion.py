r"""Recursive filters over several runs at once, as one solution of a triangular system of few diagonals."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg.lapack import dtbtrs


def recursive(
    drive: np.ndarray, feedback: Sequence[float | np.ndarray], starts: np.ndarray | None = None
) -> np.ndarray:
    r"""Return the recursion of a drive with its own past, :math:`y_k = d_k + \sum_i f_i\, y_{k-i}`."""
    n = len(drive)
    if not n:
        return np.zeros_like(drive, dtype=float)
    bands = np.zeros((len(feedback) + 1, n))
    bands[0] = 1.0
    first = np.zeros(n, dtype=int)
    if starts is not None:
        first[starts] = starts
    begin = np.maximum.accumulate(first)
    for lag, weight in enumerate(feedback, start=1):
        rows = np.arange(lag, n)
        inside = rows - lag >= begin[lag:]
        bands[lag, : n - lag] = np.where(inside, -np.broadcast_to(weight, n)[lag:], 0.0)
    solution, info = dtbtrs(bands, np.asarray(drive, dtype=float).reshape(n, -1), uplo="L", diag="U")
    if info:
        raise ValueError(f"dtbtrs returned {info}")
    return np.asarray(solution).reshape(drive.shape)


def past(x: np.ndarray, keep: float | np.ndarray, starts: np.ndarray) -> np.ndarray:
    r"""Return the exponentially weighted past, :math:`y_k = (1 - f)\, x_k + f\, y_{k-1}`, from the first value."""
    drive = (1.0 - keep) * x
    drive[starts] = x[starts]
    return recursive(drive, [keep], starts)

r"""Two sensors of one motion held against each other: a position, and the velocity that is its rate.

No force enters, so that a fault of either sensor is not read as one. Over a step of h seconds

.. math:: \frac{x_{k+1} - x_k}{h} = \frac{v_k + v_{k+1}}{2} + \frac{h}{12} (a_k - a_{k+1}) + O(h^4)

with the accelerations at the ends of the step as the simulator has them (Hermite's rule). How two channels are sampled
is known to half a step: a velocity may be a difference of positions, or both come from a simulation by Euler's method,

.. math:: v = \dot x(t \mp \tfrac{h}{2}) \approx \dot x \mp \tfrac{h}{2} \ddot x

so that such a skew is fitted like a parameter with half a step of tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...equations.windows import average
from ...simulators.port_log import PortLog


def both_measured(pairs: Mapping[str, str], log: PortLog) -> dict[str, str]:
    """Return the velocities by positions where the log holds both.

    Parameters
    ----------
    pairs : mapping of str to str
        Velocities by positions.
    log : PortLog
        The log.
    """
    return {x: v for x, v in pairs.items() if x in log.channels and v in log.channels}


def curvature(start: np.ndarray, end: np.ndarray, dt: float) -> np.ndarray:
    """Return what a mean of two velocities lacks of the mean over the step.

    Parameters
    ----------
    start, end : array, shape (n_steps,)
        Accelerations at the ends of each step.
    dt : float
        Its length, s.
    """
    return dt / 12.0 * (start - end)


def half_a_step(v: np.ndarray, log: PortLog, n: int, firsts: Sequence[np.ndarray]) -> np.ndarray:
    """Return what half a step between the clocks of a position and its velocity does to their windows.

    Parameters
    ----------
    v : array, shape (n_rows,)
        The velocity.
    log : PortLog
        The log.
    n : int
        Samples in a window.
    firsts : sequence of array of int
        For each run where its windows begin.
    """
    found = [average(0.5 * np.diff(v[a:e]), n, 2, first) for (a, e), first in zip(log.spans, firsts, strict=True)]
    return np.concatenate(found)

r"""Rates that curve within a step: the mean of a rate over it is not that of its ends.

A drive that is fast for the sampling follows each held command within the step, at whose end all is quiet again.
Simpson's rule, with the state at mid-step on a cubic, :math:`\tfrac12 (x_0 + x_1) + \tfrac h8 (\dot x_0 - \dot x_1)`,
shows by how much,

.. math:: \bar f = \tfrac16 f_0 + \tfrac23 f_{1/2} + \tfrac16 f_1

and where that is much, the simulator is run over each step from its start to x', which gives the mean exactly,
:math:`\bar f = (x' - x_0) / h`. Which steps an integrator took there shows, too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...simulators.base import Simulator
from ...simulators.integrate import STEPS, Runner
from ...simulators.port_log import PortLog
from .between_rows import after
from .tolerances import rms

MATTERS = 0.02
"""Share of a rate that its bend may be: of a swing of 13 rows a period a line misses as much, and Simpson's rule on a
cubic a hundredth of that."""
FRACTIONS = 1, 2, 4
"""Parts of a model's own step by which a log may have been made: 2 ms is a default that users often halve."""


def simpson(
    simulator: Simulator, log: PortLog, x: np.ndarray, rates: np.ndarray, inputs: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """Return the contribution of curvature to mean rates over each step, from both of its ends; inputs at mid-step."""
    start, end = np.hsplit(rates, 2)
    middle = 0.5 * (x + after(x, log)) + log.dt / 8.0 * (start - end)
    return 2.0 / 3.0 * (simulator.rate(log.t + 0.5 * log.dt, middle, inputs, p) - 0.5 * (start + end))


def matters(bend: np.ndarray, rates: np.ndarray) -> bool:
    """Return whether some rate bends so much within a step that it takes a run to know by how much."""
    return any(rms(row) > MATTERS * rms(known) for row, known in zip(bend, rates, strict=True))


def steps_of(simulator: Simulator) -> list[float]:
    """Return the steps by which a log may have been made: as good as none, and a model's own or parts of it."""
    return [0.0, *(simulator.own_step / n for n in FRACTIONS if simulator.own_step)]


def fewest(of: Callable[[int], np.ndarray], exact: np.ndarray, allowed: np.ndarray) -> int:
    """Return the fewest steps over a sample, of halves of `STEPS`, that miss exact rates by less than is allowed."""
    count = STEPS
    while count > 1 and all(rms(row) <= much for row, much in zip(of(count // 2) - exact, allowed, strict=True)):
        count //= 2
    return count


def means(
    simulator: Simulator, log: PortLog, step: float, x: np.ndarray, starts: np.ndarray, ends: np.ndarray, p: np.ndarray,
    exact: int = STEPS,
) -> np.ndarray:  # fmt: skip
    """Return the means of rates over each step, from inputs at its start to its end; a step of 0 takes `exact` ones."""
    later = simulator.own_steps(x, starts, ends, p, log.dt, step, exact)
    if later is None:
        t = np.stack([log.t, log.t + log.dt])
        later = Runner(simulator, log.dt, (), exact, True).states(t, x, np.stack([starts, ends]), p)[1]
    return np.asarray((later - x) / log.dt)


def carried(slopes: np.ndarray, dt: float) -> np.ndarray:
    r"""Return the change of the mean rates over a step by constant additions to rates, :math:`\varphi_1(A h)`.

    A force moves a speed within the step, and thus the position and whatever else follows it.
    """
    from scipy.linalg import expm

    n = len(slopes)
    return np.asarray(expm(np.block([[slopes * dt, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:])

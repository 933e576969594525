r"""Two sensors of one motion compared with each other: a position and its rate, the velocity.

No force enters, so that a sensor fault is not mistaken for one. Over a step of h seconds

.. math:: \frac{x_{k+1} - x_k}{h} = \frac{v_k + v_{k+1}}{2} - \frac{\kappa}{12} \delta^2 v, \qquad 0 \le \kappa \le 3

with the second difference of the velocities about the step. Where commands are held over it, the velocity bends at
samples alone and κ is 0; where it bends smoothly, κ is 1; where a command changes inside a step, up to 1.5; and for a
velocity that is a central difference of the positions κ is 3. A drive that is fast for the sampling follows each
command within the step, at whose ends all is quiet again, and the mean is up to

.. math:: -\tfrac{h}{12} \bigl(a(x_{k+1}, u_k) - a(x_k, u_k)\bigr)

aside with the modelled accelerations under the command of that step: like a gain of one of the readings.

The relative timing of two channels is known to half a step: a velocity may be a difference of positions, or both come
from a simulation by Euler's method,

.. math:: v = \dot x(t \mp \tfrac{h}{2}) \approx \dot x \mp \tfrac{h}{2} \ddot x

so that such a skew and κ are fitted like parameters with a tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...equations.windows import average
from ...simulators.port_log import PortLog
from .between_rows import after

ACCURACY = 1e-3
"""Share of a reading to which another one of the same motion can be held: the best usual class of instruments is 0.1
(IEC 60051-1)."""


def both_measured(pairs: Mapping[str, str], log: PortLog) -> dict[str, str]:
    """Return the velocities by positions where the log holds both."""
    return {x: v for x, v in pairs.items() if x in log.channels and v in log.channels}


def as_read(
    derived: Mapping[str, str], readings: Mapping[str, np.ndarray], states: Sequence[str], x: np.ndarray, log: PortLog
) -> np.ndarray | float:
    """Return what the rates of positions lack so that these are compared with speeds as read, not as derived."""
    read = [(q, v) for q, v in derived.items() if v in readings]
    if not read:
        return 0.0
    out = np.zeros((len(x), 2 * log.n))
    for q, v in read:
        lacking = (readings[v] - x[list(states).index(v)])[None]
        out[list(states).index(q)] = np.hstack([lacking, after(lacking, log)])
    return out


def bent(v: np.ndarray) -> np.ndarray:
    """Return the curvature terms of steps at the likely κ of 1.5; twice that is the most."""
    if len(v) < 4:
        return np.zeros(max(len(v) - 1, 0))
    inner = (v[3:] - v[2:-1] - v[1:-2] + v[:-3]) / 16.0
    return np.concatenate([inner[:1], inner, inner[-1:]])


def nuisances(
    v: np.ndarray, a: np.ndarray, log: PortLog, n: int, firsts: Sequence[np.ndarray]
) -> dict[str, np.ndarray]:
    """Return the change of the windows by half a step between clocks, and by a velocity's motion within a step."""
    within = log.dt / 12.0 * np.subtract(*np.split(a, 2)[::-1])
    runs = [(v[k:e], within[k : e - 1], first) for (k, e), first in zip(log.spans, firsts, strict=True)]
    return {
        "skew": np.concatenate([average(0.5 * np.diff(x), n, 2, first) for x, _, first in runs]),
        "bend": np.concatenate([average(bent(x), n, 2, first) for x, _, first in runs]),
        "drive": np.concatenate([average(inside, n, 2, first) for _, inside, first in runs]),
    }

r"""Speeds that follow from positions are smoothed, and smoothing rounds them where a motion turns.

Where a force is linear in such a speed, as a servo's damping is, the weak form needs no smoothing: over a step the mean
of the speed is the difference of the positions,

.. math:: \frac1h\int_{t_k}^{t_{k+1}} \dot x\,\mathrm{d}t = \frac{x_{k+1} - x_k}{h}

so what smoothing removes is put back with the typical slope of the rates over the speed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...simulators.base import Simulator
from ...simulators.port_log import PortLog
from ...simulators.structure import spread_numbers
from .between_rows import after, before


def speed_slopes(
    simulator: Simulator, derived: Mapping[str, str], t: np.ndarray, x: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Return the typical slopes of all rates in derived speeds, (n_states, n_derived); those of positions are zero."""
    slopes = typical_slopes(simulator, list(derived.values()), t, x, u)
    slopes[[simulator.states.index(position) for position in derived]] = 0.0
    return slopes


def typical_slopes(simulator: Simulator, of: Sequence[str], t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the typical slopes of all rates in some states at some instants, shape (n_states, n_of)."""
    p, slopes = spread_numbers(simulator, x.shape[1]), []
    for name in of:
        k = simulator.states.index(name)
        step = 0.1 * float(np.std(x[k])) or 1.0
        up, down = x.copy(), x.copy()
        up[k] += step
        down[k] -= step
        found = (simulator.rate(t, up, u, p) - simulator.rate(t, down, u, p)) / (2.0 * step)
        slopes.append(np.nan_to_num(np.median(found, axis=1)))  # a dry friction turns at few of the instants
    return np.column_stack(slopes) if slopes else np.zeros((len(simulator.states), 0))


def rounded_off(simulator: Simulator, derived: Mapping[str, str], x: np.ndarray, log: PortLog) -> np.ndarray:
    """Return the motion of positions in each step less that of their derived speeds, shape (n_derived, n_rows)."""
    names = list(simulator.states)
    q, v = ([names.index(name) for name in some] for some in (derived.keys(), derived.values()))
    return lacking(x[q], x[v], log)


def lacking(q: np.ndarray, v: np.ndarray, log: PortLog) -> np.ndarray:
    """Return the motion of positions in each step less that of their speeds, shape (n_signals, n_rows)."""
    lack = (after(q, log) - q) / log.dt - 0.5 * (v + after(v, log))
    lack[:, [b - 1 for _, b in log.spans]] = 0.0  # no step begins there
    return np.asarray(lack)


def with_what_lacks(
    force: Callable[[np.ndarray], np.ndarray], q: np.ndarray, v: np.ndarray, log: PortLog
) -> np.ndarray:
    """Return a force at a derived speed, corrected for the missing motion where it is linear in the speed."""
    step = 0.1 * float(np.std(v)) or 1.0
    slope = float(np.nan_to_num(np.median((force(v + step) - force(v - step)) / (2.0 * step))))
    lack = lacking(q[None], v[None], log)
    return np.asarray(force(v) + slope * 0.5 * (lack + before(lack, log))[0])

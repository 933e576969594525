r"""Forces that set in between two rows, as of a contact or a stop: no rule knows the mean of the rates over that step.

A rate that jumps by :math:`\Delta` at an unknown instant of a step of h seconds lies :math:`\pm\Delta/3` beside the
line under Simpson's rule, which misses its mean by :math:`\Delta/6` in the root mean square. A velocity whose rate
changes by A within a step has a mean of

.. math:: \tfrac12 (v_0 + v_1) - A h \left(\tfrac1{12} \pm \tfrac1{12 \sqrt 5}\right)

there. Where rates are smooth, neighbours bend alike, so that what stands out from them is such a step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...simulators.port_log import PortLog
from .window_noise import REPLICATES


def standing_out(x: np.ndarray, log: PortLog) -> np.ndarray:
    """Return by how much each step differs from the mean of its neighbours in its run, shape (n_signals, n_rows)."""
    out, x = np.zeros_like(x), np.nan_to_num(x)
    for a, b in log.spans:
        steps = x[:, a : b - 1]
        if steps.shape[1] > 2:
            out[:, a + 1 : b - 2] = np.abs(steps[:, 1:-1] - 0.5 * (steps[:, :-2] + steps[:, 2:]))
    return out


def at_unknown_instants(
    curve: np.ndarray, rates: np.ndarray, states: Sequence[str], pairs: Mapping[str, str], log: PortLog
) -> np.ndarray:
    """Return how unsure the states' mean rates are in each step, by Simpson's `curve` and the `rates` at both ends."""
    start, end = np.hsplit(rates, 2)
    out, kinks = 0.5 * standing_out(curve, log), log.dt / (12.0 * np.sqrt(5.0)) * standing_out(end - start, log)
    for position, velocity in pairs.items():
        out[list(states).index(position)] = kinks[list(states).index(velocity)]
    return out


def root_mean_square(change: np.ndarray, windows: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the root mean square at each window of changes whose signs in each step are unknown."""
    if not np.any(change):
        return np.zeros_like(windows(np.tile(change, 2)))
    rng = np.random.RandomState(2)
    signs = (rng.randint(0, 2, size=change.shape) * 2.0 - 1.0 for _ in range(REPLICATES))
    return np.asarray(np.sqrt(np.mean([np.square(windows(np.tile(s * change, 2))) for s in signs], axis=0)))

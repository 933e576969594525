r"""Inputs that jump between two rows of a log: no row says at which instant, and a simulator of runs chooses one.

Rows that were not read where they lie, but interpolated, leave open for any simulator when an input jumped. Of a change
between two rows, the part beyond the changes before and after it is such a jump, :math:`J`. Half a sample
early, it is worth :math:`J / 4` at either row; at an instant that may be anywhere between them it is uncertain by
:math:`1 / \sqrt 3` of that. Fronts that travel, as in a pipe, carry this to all windows that they reach, and nowhere
else: there it is noise, and no cause.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...simulators.port_log import PortLog

NOTE = "Inputs jump between rows, at instants that the log does not show: the error from this counts as noise."


def off_rows(inputs: Sequence[str], log: PortLog) -> np.ndarray:
    """Return how far interpolated rows of inputs may be off where these jump, shape (n_inputs, n_rows)."""
    rows = [log.between.get(name) for name in inputs]
    return np.reshape([np.zeros(log.n) if one is None else one.jump for one in rows], (len(rows), log.n))


def jumps(u: np.ndarray, log: PortLog) -> np.ndarray:
    """Return the jump of each input from each row to the next, shape (n_inputs, n_rows); the last of a run is zero."""
    out = np.zeros_like(u)
    for a, b in log.spans:
        steps = np.diff(u[:, a:b], axis=1)
        if steps.shape[1] > 2:
            around = np.stack([steps[:, :-2], steps[:, 1:-1], steps[:, 2:]])
            out[:, a + 1 : b - 2] = steps[:, 1:-1] - np.median(around, axis=0)
    return out


def unknown_instants(
    jump: np.ndarray, off: np.ndarray, windows: Callable[[np.ndarray], np.ndarray], draws: int
) -> np.ndarray:
    """Return the root mean square at each window of what other instants of jumps change, over draws of their signs."""
    rng = np.random.RandomState(3)
    early = jump / (4.0 * np.sqrt(3.0))
    begins = (off > 0.0) & (np.roll(off, 1, axis=1) == 0.0)
    stretch = np.cumsum(begins, axis=1)  # rows between the same two readings are off together
    drawn = []
    for _ in range(draws):
        one = early * (rng.randint(0, 2, size=jump.shape) * 2.0 - 1.0)
        change = one + np.roll(one, 1, axis=1)
        if np.any(off):
            signs = rng.randint(0, 2, size=jump.shape) * 2.0 - 1.0
            change += off * np.take_along_axis(signs, stretch, axis=1)
        drawn.append(windows(change))
    return np.asarray(np.sqrt(np.mean(np.square(drawn), axis=0)))

"""What depends on the path of a signal, not on time: where it turns, and what follows it with play."""

from __future__ import annotations

import numpy as np


def reversals(x: np.ndarray) -> np.ndarray:
    """Return the rows at which a signal turns, its first and last row included.

    Parameters
    ----------
    x : array, shape (n,)
        The signal.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.paths import reversals
    >>> reversals(np.array([0.0, 1.0, 2.0, 1.0, 0.0, 1.0]))
    array([0, 2, 4, 5])
    """
    moved = np.flatnonzero(np.diff(x))
    sign = np.sign(x[moved + 1] - x[moved])
    turned = moved[1:][sign[1:] != sign[:-1]]
    return np.unique(np.concatenate([[0], turned, [len(x) - 1]]))


def play(x: np.ndarray, width: float) -> np.ndarray:
    r"""Follow a signal with a play of ± ``width``: y stays until x would leave [y − width, y + width].

    .. math:: y_k = \min(\max(y_{k-1}, x_k - w), x_k + w)

    A clip of a clip is a clip, so the steps are combined pairwise, in log₂ n passes over the signal.

    Parameters
    ----------
    x : array, shape (n, ...)
        The signal, time along the first axis.
    width : float
        Half the play, not negative.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.paths import play
    >>> play(np.array([0.0, 1.0, 0.5, -1.0]), 0.5)
    array([ 0. ,  0.5,  0.5, -0.5])
    """
    low, high = x - width, x + width
    low[0] = high[0] = x[0]
    shift = 1
    while shift < len(x):
        new_low = np.clip(low[:-shift], low[shift:], high[shift:])
        new_high = np.clip(high[:-shift], low[shift:], high[shift:])
        low[shift:], high[shift:] = new_low, new_high
        shift *= 2
    return low

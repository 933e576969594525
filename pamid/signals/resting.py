"""Rows in which a position rests: there friction balances any drive, and the drive contains no information."""

import numpy as np

from .noise import noise_level
from .stretches import equal_stretches

DURATION = 0.1
"""Shortest rest, s; rests and motions are found equally well with half and with twice as much
(``benchmarks/settings.py --computed``)."""
ROWS = 20
"""Least rows of a rest."""
SLOW = 0.01
"""Share of the fastest motion below which a position may rest; it matters as little."""
NOISE = 8.0
"""Range that a hundred samples of noise alone exceed once in 14,000 times, in standard deviations: the studentised
range (``scipy.stats.studentized_range.sf(8, 100, inf)``)."""


def resting_rows(x: np.ndarray, dt: float, codes: np.ndarray) -> np.ndarray:
    """Return the rows in which a moving position rests: it changes by no more than its noise over `DURATION`.

    Where the noise could hide a motion that matters, means of two rows are taken over twice as long, then of four.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

    out, least, rows = np.zeros(len(x), dtype=bool), max(ROWS, round(DURATION / dt)), 1
    spans = equal_stretches(codes)
    level = {(a, b): NOISE * noise_level(x[a:b]) for a, b in spans if b - a > least}
    while runs := [(a, b) for a, b in spans if b - a > least * rows]:
        n, moved = least * rows, dict[tuple[int, int], np.ndarray]()
        noise = {span: level[span] / np.sqrt(rows) for span in runs}
        for a, b in runs:
            mean = uniform_filter1d(x[a:b], rows)
            moved[a, b] = maximum_filter1d(mean, n) - minimum_filter1d(mean, n)
        fastest = float(np.quantile(np.concatenate(list(moved.values())), 0.99))
        for (a, b), over in moved.items():
            if noise[a, b] <= SLOW * fastest:
                # All rows of a window at rest are at rest, not only that at its centre.
                out[a:b] = maximum_filter1d((over <= noise[a, b]).astype(np.int8), n, origin=0 if n % 2 else -1) > 0
        spans = [span for span in runs if noise[span] > SLOW * fastest]
        rows *= 2
    return out


def at_rest(name: str, share: float) -> str:
    """Return a note that rows at rest are left out."""
    return f"{name} rests in {100 * share:.1f} % of the rows, which are left out: at rest, friction balances any drive."

r"""How well parts of a log agree on the size of an effect: runs, parts of the state, slow and fast changes.

An effect is taken as its contribution d times a factor that is 1 at the fit. The factors of all runs, or of parts of
the state, show whether it is one cause: Cochran's Q, the share I² of it that is not chance, and the spread τ of the
factors (DerSimonian and Laird),

.. math:: Q = \sum_t h_t (\theta_t - \bar\theta)^2, \qquad I^2 = \max(0, 1 - \tfrac{n-1}{Q}), \qquad
    \tau^2 = \max\Big(0, \frac{Q - (n - 1)}{\sum h_t - \sum h_t^2 / \sum h_t}\Big)

with h the information of a run about its factor.

References
----------
W. G. Cochran, "The combination of estimates from different experiments", Biometrics 10(1), 1954.
https://doi.org/10.2307/3001666

J. P. T. Higgins, S. G. Thompson, "Quantifying heterogeneity in a meta-analysis", Statistics in Medicine 21(11), 2002.
https://doi.org/10.1002/sim.1186
"""

from typing import NamedTuple

import numpy as np

from ..residuals.protocol import ResidualSource, lanes

STRETCHES = 8
"""Stretches of equal information in which a factor is estimated: enough for the jackknife, each longer than the
memory."""
OCTAVES = 5
"""Octaves of rates that are distinguished, a window being 20 ms."""


class Agreement(NamedTuple):
    """How well parts of a log agree on the size of an effect."""

    q: float
    """Cochran's Q."""
    i2: float
    """Share of it beyond chance, I²."""
    spread: float
    """Spread τ of the factors beyond chance."""
    least: float
    """The same with Q compared with the 95 % quantile of chance: parts with little information disagree by chance."""
    half: float
    """Half of the 90 % interval of the factor by the jackknife over the parts; 1 and more: the effect may be zero."""


def agreement(information: np.ndarray, score: np.ndarray) -> Agreement:
    """Return how well parts agree on a factor."""
    from scipy.special import chdtri, stdtrit

    known = information > 1e-12 * max(float(np.max(information, initial=0.0)), 1e-300)
    h, g = information[known], score[known]
    n, total = len(h), float(h.sum())
    if n < 2:
        return Agreement(0.0, 0.0, 0.0, 0.0, 1.0)
    factor = g / h
    q = float(np.sum(h * np.square(factor - g.sum() / total)))
    room = total - float(np.sum(h * h)) / total
    spread, least = (
        float(np.sqrt(max(0.0, q - chance) / room)) if room > 0 else 0.0 for chance in (n - 1, chdtri(n - 1, 0.05))
    )
    without = (g.sum() - g) / np.maximum(total - h, 1e-12 * total)
    error = float(np.sqrt((n - 1.0) / n * np.sum(np.square(without - without.mean()))))
    half = float(stdtrit(n - 1, 0.95)) * max(error, total**-0.5)
    return Agreement(q, max(0.0, 1.0 - (n - 1) / q) if q > 0 else 0.0, spread, least, half)


def over_labels(label: np.ndarray, information: np.ndarray, score: np.ndarray) -> Agreement:
    """Return how well the parts that labels stand for agree on a factor."""
    return agreement(np.bincount(label, information), np.bincount(label, score))


def over_stretches(evidence: ResidualSource, information: np.ndarray, score: np.ndarray) -> Agreement:
    """Return how well stretches of equal information, runs concatenated, agree on a factor."""
    order = np.lexsort((evidence.time, evidence.block))
    told = np.cumsum(information[order])
    label = np.empty(len(order), dtype=int)
    label[order] = np.minimum(STRETCHES * told / max(float(told[-1]), 1e-300), STRETCHES - 1).astype(int)
    return over_labels(label, information, score)


def over_rates(evidence: ResidualSource, d: np.ndarray, z: np.ndarray) -> Agreement:
    """Return how well slow and fast changes agree on the factor of a contribution, octave by octave (Haar)."""
    lane = lanes(evidence)
    order = np.lexsort((evidence.time, lane))
    lane, d, z = lane[order], d[order], z[order]
    information, score = [], []
    for _ in range(OCTAVES):
        even = len(d) // 2 * 2
        same = lane[0:even:2] == lane[1:even:2]
        fast_d, fast_z = ((x[1:even:2] - x[0:even:2])[same] / np.sqrt(2.0) for x in (d, z))
        information.append(float(fast_d @ fast_d))
        score.append(-float(fast_d @ fast_z))
        d, z = ((x[1:even:2] + x[0:even:2])[same] / np.sqrt(2.0) for x in (d, z))
        lane = lane[0:even:2][same]
    information.append(float(d @ d))
    score.append(-float(d @ z))
    return agreement(np.array(information), np.array(score))

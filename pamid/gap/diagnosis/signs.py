r"""What a name must show before it is said: that it is one cause, and that nothing is left which it does not explain.

An effect is taken as its contribution d times a factor that is 1 at the fit. The factor of every run, or of every part
of the state, by itself says whether it is one cause: Cochran's Q, the share I² of it that is no chance, and the spread
τ of the factors (DerSimonian and Laird),

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

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..inference.competition import Competition
from ..inference.flexible import Flexible
from ..inference.hypotheses import Outcome
from ..residuals.protocol import ResidualSource, lanes
from ..settings import EXCESS, NU
from .closure import Clusters, closures

OCTAVES = 5
"""Octaves of rates that are distinguished, a window being 20 ms."""
LAGS = 8
"""Windows back to which what is left is held against its own past."""


class Agreement(NamedTuple):
    """How well parts of a log agree on the size of an effect.

    Parameters
    ----------
    q : float
        Cochran's Q.
    i2 : float
        Share of it beyond chance, I².
    spread : float
        Spread τ of the factors beyond chance.
    half : float
        Half of the 90 % interval of the factor by the jackknife over the parts; 1 and more: it may as well be nothing.
    """

    q: float
    i2: float
    spread: float
    half: float


def agreement(information: np.ndarray, score: np.ndarray) -> Agreement:
    """Return how well parts agree on a factor.

    Parameters
    ----------
    information : array, shape (n_parts,)
        Curvature of the likelihood in the factor.
    score : array, shape (n_parts,)
        Its slope at a factor of 1.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.gap.diagnosis.signs import agreement
    >>> found = agreement(np.full(4, 100.0), np.array([30.0, -30.0, 30.0, -30.0]))  # factors 1.3, 0.7, 1.3, 0.7
    >>> float(round(found.q, 1)), float(round(found.i2, 2)), float(round(found.spread, 2))
    (36.0, 0.92, 0.33)
    """
    from scipy.special import stdtrit

    known = information > 1e-12 * max(float(np.max(information, initial=0.0)), 1e-300)
    h, g = information[known], score[known]
    n, total = len(h), float(h.sum())
    if n < 2:
        return Agreement(0.0, 0.0, 0.0, 1.0)
    factor = g / h
    q = float(np.sum(h * np.square(factor - g.sum() / total)))
    room = total - float(np.sum(h * h)) / total
    spread = float(np.sqrt(max(0.0, q - (n - 1)) / room)) if room > 0 else 0.0
    without = (g.sum() - g) / np.maximum(total - h, 1e-12 * total)
    error = float(np.sqrt((n - 1.0) / n * np.sum(np.square(without - without.mean()))))
    half = float(stdtrit(n - 1, 0.95)) * max(error, total**-0.5)
    return Agreement(q, max(0.0, 1.0 - (n - 1) / q) if q > 0 else 0.0, spread, half)


def signs_of(
    competition: Competition, outcome: Outcome, part_of: Mapping[str, float], given_up: bool = False
) -> dict[str, float]:
    """Return the signs of a cause beyond the library, each from 0 to 1.

    Parameters
    ----------
    competition : Competition
        The library on the log.
    outcome : Outcome
        Its hypotheses.
    part_of : mapping of str to float
        Each cause's share of what all explain together.
    given_up : bool, default=False
        Whether a cause beside these was given up, since they are trusted more without it.

    Returns
    -------
    dict of str to float
        ``left``: logarithm of what is left over that of what was there, both in units of noise and inexactness, in the
        equation where most is left; a half counts as all.
        ``cancelling``: logarithm of the power of all contributions by themselves over that of their sum: what needs
        effects that undo each other; a factor of seven counts as all.
        ``faint``: logarithm of one over the smallest share of a cause, among those beside which it acts; a fiftieth
        counts as all.
        ``left_of_gap``: share of the gap's power that is left, beyond the noise.
        ``predictable``: share of what is left that a flexible function of the state predicts on other trajectories.
        ``coloured``: root mean square correlation of what is left with its own past, where that is most.
        ``disagreeing``, ``uneven``: spread of the factors over runs, and over halves of the state, of the cause for
        which it is largest.
        ``paced``: the same over slow and fast changes, octave by octave.
        ``uncertain``: half of the 90 % interval of the least certain factor.
        ``rivalled``: how much of what a cause adds to the gain the best set that lacks it has, where that is most.
        ``many``: number of causes beyond the first in the equation that has most; four count as all.
        ``given_up``: whether a cause beside these was given up: of an imitation by several that leaves the best part.
        ``unclosed``: one less the lower end of the 90 % interval of what is closed on unseen runs, where that is least.
    """
    evidence, best, base = competition.evidence, outcome.best, outcome.base
    before, after = evidence.raw(base.fit.z), evidence.raw(best.fit.z)
    contributions = competition.discrepancy.contributions(best.fit)
    each = [evidence.raw(d) for d in contributions.values()]
    alone = sum(float(np.sum(np.square(d))) for d in each)
    together = float(np.sum(np.square(np.sum(each, axis=0)))) if each else 0.0
    room = still = left = predictable = coloured = 0.0
    flexible, shares = Flexible(evidence), beside(competition, outcome, part_of)
    for name, part, was, now in zip(evidence.equations, evidence.parts, base.left, best.left, strict=True):
        room += _excess(before[part])
        more = _excess(after[part])
        if more > still and part.stop - part.start > 60:
            predictable = flexible.remainder(name, best.fit.z).share
        still = still + more
        # The noise is known to a few per cent, and the scale of few windows to no better.
        if min(was, now) > 1.0 + EXCESS + np.sqrt(2.0 / max(part.stop - part.start, 1)):
            left = max(left, float(np.log(now) / np.log(was)))
        coloured = max(coloured, _colour(competition, best.z, part))
    found = {
        "left": 2.0 * left,
        "cancelling": 0.5 * np.log(alone / together) if together > 0 else 0.0,
        "faint": -0.25 * np.log(max(min(shares.values(), default=1.0), 1e-3)),
        "left_of_gap": still / room if room > 0 else 0.0,
        "predictable": predictable,
        "coloured": coloured,
        **_of_factors(competition, outcome, competition.discrepancy.whole(best.fit)),
        "unclosed": _unclosed(competition, outcome),
        "rivalled": _rivalled(outcome),
        "many": (max(Counter(_main_parts(competition, outcome).values()).values(), default=1) - 1) / 3.0,
        "given_up": float(given_up),
    }
    return {name: float(np.clip(v, 0.0, 1.0)) for name, v in found.items()}


def _of_factors(
    competition: Competition, outcome: Outcome, contributions: Mapping[str, np.ndarray]
) -> dict[str, float]:
    """Return how far runs and parts of the state disagree on the causes, and how uncertain the least certain one is."""
    evidence, fit = competition.evidence, outcome.best.fit
    # A parameter at the end of its tolerance takes up nothing: a cause may be what is beyond.
    J = evidence.slopes(fit.spec, fit.x)[:, fit.inside]
    weight = np.empty(len(fit.z))
    for part, s, share in zip(evidence.parts, fit.scales, competition.fitter.weights, strict=True):
        weight[part] = share * (NU + 1.0) / (NU + np.square(fit.z[part] / s)) / s**2
    found = {"disagreeing": 0.0, "uneven": 0.0, "uncertain": 0.0, "paced": 0.0}
    for whole in contributions.values():
        # A cause beyond the tolerance of the same parameter is what goes beyond it, and is not taken up by it.
        others = J[:, ~np.isclose(_cosines(J, whole), 1.0, atol=1e-2)]
        d = whole - others @ np.linalg.lstsq(others, whole, rcond=None)[0] if others.shape[1] else whole
        information, score = weight * d * d, -weight * d * fit.z
        runs = _summed(evidence.block, information, score)
        found["disagreeing"] = max(found["disagreeing"], runs.spread)
        found["uncertain"] = max(found["uncertain"], runs.half)
        found["paced"] = max(found["paced"], _over_rates(evidence, np.sqrt(weight) * d, np.sqrt(weight) * fit.z).spread)
        for x in evidence.state.values():
            known = np.isfinite(x)
            if known.any() and np.ptp(x[known]) > 0.0:
                middle = np.average(x[known], weights=information[known]) if information[known].any() else 0.0
                halves = _summed((x[known] > middle).astype(int), information[known], score[known])
                found["uneven"] = max(found["uneven"], halves.spread)
    return found


def _cosines(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return how nearly each column goes the way of a vector, from 0 to 1."""
    size = np.sqrt(np.sum(np.square(A), axis=0) * float(x @ x))
    return np.asarray(np.abs(x @ A) / np.maximum(size, 1e-300))


def _summed(label: np.ndarray, information: np.ndarray, score: np.ndarray) -> Agreement:
    return agreement(np.bincount(label, information), np.bincount(label, score))


def _over_rates(evidence: ResidualSource, d: np.ndarray, z: np.ndarray) -> Agreement:
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


def _colour(competition: Competition, z: np.ndarray, part: slice) -> float:
    """Return the root mean square correlation of what is left in an equation with its own past, beyond chance."""
    evidence = competition.evidence
    order = np.lexsort((evidence.time[part], evidence.side[part], evidence.run[part]))
    x = z[part][order]
    size = float(np.median(np.abs(x))) / 0.6745 if len(x) else 0.0
    if len(x) < 10 * LAGS or size <= 0.0:
        return 0.0
    x = np.clip(x, -4.0 * size, 4.0 * size)
    lane = (evidence.run[part] * 16 + evidence.side[part])[order]
    power, total = float(np.mean(x * x)), 0.0
    for lag in range(1, LAGS + 1):
        same = lane[lag:] == lane[:-lag]
        if same.any():
            total += float(np.mean((x[lag:] * x[:-lag])[same]) / power) ** 2 - 1.0 / float(same.sum())
    return float(np.sqrt(max(total, 0.0) / LAGS))


def beside(competition: Competition, outcome: Outcome, part_of: Mapping[str, float]) -> dict[str, float]:
    """Return each cause's share of what those explain that act most in the same equation.

    What imitates or mends the form of another acts where that does; causes of other equations say nothing about it.
    """
    main = _main_parts(competition, outcome)
    whole = dict.fromkeys(main.values(), 0.0)
    for name, part in part_of.items():
        whole[main[name]] += max(part, 0.0)
    return {name: max(part, 0.0) / whole[main[name]] if whole[main[name]] else 1.0 for name, part in part_of.items()}


def _main_parts(competition: Competition, outcome: Outcome) -> dict[str, int]:
    fit = outcome.best.fit
    return {name: competition.discrepancy.main_part(fit, name) for name in fit.spec}


def _rivalled(outcome: Outcome) -> float:
    """Return how much of what a cause adds to the gain the best set has that lacks it, where that is most.

    Held against the gain of all causes, that would grow with the number of causes, however sure each of them is.
    """
    best, base = outcome.best, outcome.base
    found = 0.0
    for name in best.names:
        rest = max((h.score for h in outcome.refitted if h.names <= best.names - {name}), default=base.score)
        other = max((h.score for h in outcome.refitted if name not in h.names), default=base.score)
        rest = max(rest, base.score)
        found = max(found, (other - rest) / max(best.score - rest, 1.0))
    return found


def _unclosed(competition: Competition, outcome: Outcome) -> float:
    """Return one less the lower end of what the causes close on unseen runs, of the equations that they act in most."""
    evidence, fit = competition.evidence, outcome.best.fit
    clusters = Clusters(competition.fitter, fit)
    before, after = evidence.raw(outcome.base.fit.z), evidence.raw(clusters.z)
    found = closures(evidence, before, evidence.raw(clusters.held_out()), after, np.random.RandomState(0))
    main = {competition.discrepancy.main_part(fit, name) for name in fit.spec}
    return max((1.0 - found[k].ci90[0] for k in main), default=0.0)


def _excess(z: np.ndarray) -> float:
    """Return by how much residuals exceed their noise, a sum of squares to which no window adds without bound."""
    power = np.square(z)
    return max(float(np.sum(np.minimum(power, 36.0 * (np.median(power) + 1.0)))) - len(z), 0.0)

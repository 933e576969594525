r"""Whether what was named is the cause, or only looks like it: what a name must show before it is said.

A cause that the library does not hold is mostly imitated by one or several effects of it, with a high likelihood. It is
given away by what the imitation leaves above the noise and the inexactness that its forms are allowed, and by effects
that undo or mend each other. These signs are weighed by logistic regression,

.. math:: p = \frac{1}{1 + \exp(-(c_0 + \sum_i c_i s_i))}

fitted to logs of benches whose cause is in the library and of ones whose cause is not; a name is said where p is above
the threshold at which at most one in twenty of the names said on such logs is wrong.

References
----------
A. N. Angelopoulos, S. Bates, A. Fisch, L. Lei, T. Schuster, "Conformal risk control", ICLR 2024.
https://doi.org/10.48550/arXiv.2208.02814
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..inference.competition import Competition, Outcome
from ..inference.flexible import Flexible
from ..inference.settings import HALF, NOTICED, SIGNS, TRUSTED


@dataclass(frozen=True)
class Trust:
    """What speaks for names being right.

    Parameters
    ----------
    probability : float
        Probability that they are.
    named : bool
        Whether that is enough to say them.
    signs : dict of str to float
        What it rests on, see `signs_of`.
    """

    probability: float
    named: bool
    signs: dict[str, float]


def trust(competition: Competition, outcome: Outcome, part_of: Mapping[str, float]) -> Trust:
    """Return what speaks for the names of the best hypothesis.

    Parameters
    ----------
    competition : Competition
        The library on the log.
    outcome : Outcome
        Its hypotheses.
    part_of : mapping of str to float
        Each cause's share of what all explain together.
    """
    signs = signs_of(competition, outcome, part_of)
    if not competition.evidence.exact:
        # Any other model may be wrong in several small ways at once: names are said of what they close.
        closed = 1.0 - signs["left_of_gap"]
        return Trust(float(1.0 / (1.0 + np.exp(-HALF * (closed - 0.5)))), closed > 0.5, signs)
    score = SIGNS["constant"] + sum(weight * signs[name] for name, weight in SIGNS.items() if name != "constant")
    probability = float(1.0 / (1.0 + np.exp(-score)))
    return Trust(probability, probability > TRUSTED, signs)


def signs_of(competition: Competition, outcome: Outcome, part_of: Mapping[str, float]) -> dict[str, float]:
    """Return the signs of a cause beyond the library, each from 0 to 1.

    Returns
    -------
    dict of str to float
        ``left``: logarithm of what is left over that of what was there, both in units of noise and inexactness, in the
        equation where most is left; a half counts as all.
        ``cancelling``: logarithm of the power of all contributions by themselves over that of their sum: what needs
        effects that undo each other; a factor of seven counts as all.
        ``faint``: logarithm of one over the smallest share of a cause; a fiftieth counts as all.
        ``left_of_gap``: share of the gap's power that is left, beyond the noise.
        ``predictable``: share of what is left that a flexible function of the state predicts on other trajectories.
    """
    evidence, best, base = competition.evidence, outcome.best, outcome.base
    before, after = evidence.raw(base.fit.z), evidence.raw(best.fit.z)
    each = [evidence.raw(d) for d in competition.discrepancy.contributions(best.fit).values()]
    alone = sum(float(np.sum(np.square(d))) for d in each)
    together = float(np.sum(np.square(np.sum(each, axis=0)))) if each else 0.0
    room = still = left = predictable = 0.0
    flexible = Flexible(evidence)
    for name, part, was, now in zip(evidence.equations, evidence.parts, base.left, best.left, strict=True):
        room += _excess(before[part])
        more = _excess(after[part])
        if more > still and part.stop - part.start > 60:
            predictable = flexible.remainder(name, best.fit.z).share
        still = still + more
        if was > NOTICED[0] and now > NOTICED[1]:
            left = max(left, float(np.log(now) / np.log(was)))
    return {
        "left": min(2.0 * left, 1.0),
        "cancelling": float(np.clip(0.5 * np.log(alone / together), 0.0, 1.0)) if together > 0 else 0.0,
        "faint": float(np.clip(-0.25 * np.log(max(min(part_of.values(), default=1.0), 1e-3)), 0.0, 1.0)),
        "left_of_gap": float(np.clip(still / room, 0.0, 1.0)) if room > 0 else 0.0,
        "predictable": min(predictable, 1.0),
    }


def _excess(z: np.ndarray) -> float:
    """Return by how much residuals exceed their noise, a sum of squares to which no window adds without bound."""
    power = np.square(z)
    return max(float(np.sum(np.minimum(power, 36.0 * (np.median(power) + 1.0)))) - len(z), 0.0)

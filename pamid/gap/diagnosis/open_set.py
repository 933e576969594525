r"""Whether what was named is the cause, or only looks like it: what a name must show before it is said.

A cause that the library does not hold is mostly imitated by one or several effects of it, with a high likelihood. It is
given away by what the imitation leaves: a residual above the noise and the inexactness that its forms are allowed,
which a flexible function of the state still predicts, and by effects that mend each other. These signs are weighed by
logistic regression,

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

from ...effects import all_effects
from ..inference.competition import Competition, Outcome, degenerate
from ..inference.discrepancy import has_form
from ..inference.flexible import Flexible
from ..inference.settings import HALF, SIGNS, TRUSTED


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
        probability = float(1.0 / (1.0 + np.exp(-HALF * (closed - 0.5))))
        return Trust(probability, closed > 0.5, signs)
    score = SIGNS["constant"] + sum(SIGNS[name] * value for name, value in signs.items() if name in SIGNS)
    probability = float(1.0 / (1.0 + np.exp(-np.clip(score, -30.0, 30.0))))
    return Trust(probability, probability > TRUSTED, signs)


def signs_of(competition: Competition, outcome: Outcome, part_of: Mapping[str, float]) -> dict[str, float]:
    """Return the signs of a cause beyond the library.

    Returns
    -------
    dict of str to float
        ``left``: logarithm of the largest scale of what is left, in noise and inexactness, at least 0.
        ``left_of_gap``: share of the gap's power that is left, beyond the noise.
        ``predictable``: logarithm of one plus the power, in noise, that a flexible function still predicts.
        ``predictable_of_cause``: the same as an amplitude, a share of what the causes add there.
        ``causes``: effects beyond the first.
        ``mended``: effects of exact form beyond the first, each of another sensor or parameter.
        ``turned``: effects whose parameters ended where they turn into another effect.
        ``faint``: logarithm of one over the smallest share of a cause.
        ``cancelling``: logarithm of the power of all contributions by themselves over that of their sum, at least 0.
    """
    evidence, best, base = competition.evidence, outcome.best, outcome.base
    before, after = evidence.raw(base.fit.z), evidence.raw(best.fit.z)
    added = competition.discrepancy.contributions(best.fit)
    total = evidence.raw(np.sum(list(added.values()), axis=0)) if added else np.zeros(len(before))
    each = [evidence.raw(d) for d in added.values()]
    alone, together = sum(float(np.sum(np.square(d))) for d in each), float(np.sum(np.square(total)))
    flexible = Flexible(evidence)
    room = left = 0.0
    predictable = of_cause = 0.0
    for name, part in zip(evidence.equations, evidence.parts, strict=True):
        n = part.stop - part.start
        size = np.minimum(np.square(before[part]), 36.0 * np.median(np.square(before[part])) + 36.0)
        still = np.minimum(np.square(after[part]), 36.0 * np.median(np.square(after[part])) + 36.0)
        room += max(float(np.sum(size)) - n, 0.0)
        left += max(float(np.sum(still)) - n, 0.0)
        if n < 60:
            continue
        found = flexible.remainder(name, best.fit.z)
        power = found.share * float(np.mean(still))
        predictable = max(predictable, power)
        cause = float(np.sqrt(np.mean(np.square(total[part]))))
        if cause > 0.3:
            of_cause = max(of_cause, float(np.sqrt(power)) / cause)
    names = list(best.fit.spec)
    exact = [name for name in names if not has_form(name)]
    channels = {all_effects()[name].channel or name for name in exact}
    return {
        "left": float(np.log(max(1.0, *(float(v) for v in best.left)))),
        "left_of_gap": float(np.clip(left / room, 0.0, 1.0)) if room > 0 else 0.0,
        "predictable": float(np.log1p(predictable)),
        "predictable_of_cause": min(of_cause, 1.0),
        "causes": float(len(names) - 1),
        "mended": float(max(len(channels) - 1, 0)),
        "turned": float(sum(degenerate(best.fit, name) is not None for name in names)),
        "faint": float(-np.log(max(min(part_of.values(), default=1.0), 1e-3))),
        "cancelling": float(np.log(max(alone / max(together, 1e-300), 1.0))) if together > 0 else 0.0,
    }

r"""Whether what was named is the cause, or only looks like it: what a name must show before it is said.

A cause that the library does not hold is mostly imitated by one or several effects of it, with a high likelihood, and
an inexact form is mended by a further effect. Both are given away by what is left above the noise and the inexactness
that forms are allowed, and by effects that undo or mend each other. These signs are weighed for each cause by logistic
regression, one of causes that explain a gap alone and one of those that do so together,

.. math:: p = \frac{1}{1 + \exp(-(c_0 + \sum_i c_i s_i))}

fitted to logs of benches whose causes are in the library and of ones whose cause is not. A name is said where it is
more likely right than not, and with reserve (this effect, or something that looks like it on this log) unless p is
above the bar at which at most one in twenty of the names said on such logs is wrong.

Those benches are right in all but their causes. Any other model may be wrong in several small ways at once, and then
something is always left above the noise: a name is said there of what it closes. Which of both a model is nobody knows.
Names are said where they close more than they leave, a share c, and with the probability

.. math:: p' = \max\bigl(\tfrac12, \tfrac12 (p + c)\bigr).

References
----------
A. N. Angelopoulos, S. Bates, A. Fisch, L. Lei, T. Schuster, "Conformal risk control", ICLR 2024.
https://doi.org/10.48550/arXiv.2208.02814
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..inference.competition import Competition
from ..inference.hypotheses import Outcome
from .signs import signs_of
from .trusted import ALONE, BESIDE, SURE, TRUSTED


@dataclass(frozen=True)
class Trust:
    """What speaks for a name being right.

    Parameters
    ----------
    probability : float
        Probability that it is.
    signs : dict of str to float
        What it rests on, see `signs_of`.
    """

    probability: float
    signs: dict[str, float]

    @property
    def named(self) -> bool:
        """Whether that is enough to say it."""
        return self.supported and self.probability >= TRUSTED

    @property
    def grade(self) -> str:
        """How it is said: without reserve, with it, or as one of a family that acts alike."""
        return "sure" if self.sure else "reserve" if self.named else "family"

    @property
    def supported(self) -> bool:
        """Whether the log excludes that it is nothing at all."""
        return self.signs["unsupported"] < 1.0

    @property
    def closes(self) -> bool:
        """Whether the set that it belongs to closes more of the gap than it leaves, on runs that were not fitted."""
        return self.supported and self.signs["unclosed_of_gap"] <= 0.5

    @property
    def sure(self) -> bool:
        """Whether it is enough to say it without reserve."""
        return self.probability >= SURE


def trust(
    competition: Competition, outcome: Outcome, part_of: Mapping[str, float], classes: Mapping[str, Sequence[str]]
) -> dict[str, Trust]:
    """Return what speaks for each name of the best hypothesis."""
    from scipy.special import expit

    found, weights = {}, ALONE if len(outcome.best.fit.spec) == 1 else BESIDE
    for name, signs in signs_of(competition, outcome, part_of, classes).items():
        score = weights["constant"] + sum(weight * signs[n] for n, weight in weights.items() if n != "constant")
        probability = float(expit(score))
        if not competition.evidence.exact:
            closed = 1.0 - signs["left_of_gap"]
            probability = max(TRUSTED, 0.5 * (probability + closed)) if closed >= TRUSTED else closed
        found[name] = Trust(probability, signs)
    return found

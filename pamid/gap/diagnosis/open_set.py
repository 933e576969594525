r"""Whether a named effect is the cause, or only looks like it: the test that a name must pass.

A cause outside the library is usually imitated by one or several of its effects, with a high likelihood, and an inexact
form is compensated by a further effect. Both show in residuals above the noise and the allowed inexactness of forms,
and in effects that cancel or compensate each other. These signs are weighted for each cause by logistic regression, one
model for causes that explain a gap alone and one for those that do so together,

.. math:: p = \frac{1}{1 + \exp(-(c_0 + \sum_i c_i s_i))}

fitted to logs of benches whose causes are in the library and of ones whose cause is not. A name is reported where p
is at least one half, and with reservations (this effect, or something that looks like it on this log) unless p is
above the bar at which at most one in twenty of the names reported on such logs is wrong.

The simulators of those benches are correct but for the causes. Any other model may be wrong in several small ways at
once, so that something always exceeds the noise. As the two cannot be distinguished, names are also reported where
they halve the error beyond the noise in the equations that they change, also without causes that are not trusted; or in
all, where these equations show none. With the share c of its square that they close the probability is

.. math:: p' = \max\bigl(\tfrac12, \tfrac12 (p + c)\bigr) \quad\text{if } 1 - c \le \tfrac14, \qquad
    p' = \tfrac12 c \quad\text{otherwise},

and always with reservations where they explain less than a twentieth of the gap in their equation, or where the causes
beside them undo most of what they change, or most of it in some equation. A cause of whatever probability is named with
reservations where the interval of its size includes that it is none.

References
----------
A. N. Angelopoulos, S. Bates, A. Fisch, L. Lei, T. Schuster, "Conformal risk control", ICLR 2024.
https://doi.org/10.48550/arXiv.2208.02814
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log, sqrt

from ..inference.competition import Competition
from ..inference.hypotheses import Outcome
from ..settings import OF_ITS_OWN
from .signs import signs_of
from .silenced import silenced
from .taken_back import taken_back
from .trusted import ALONE, BESIDE, SURE, TRUSTED


@dataclass(frozen=True)
class Trust:
    """Evidence that a name is right."""

    probability: float
    """Probability that it is."""
    signs: dict[str, float]
    """Its signs, see `signs_of`."""
    of_its_own: bool = True
    """Whether it is too large to compensate for the causes beside it, and these do not undo most of it."""
    sized: bool = True
    """Whether the interval of its size excludes that it is none, see `pamid.gap.diagnosis.sized`."""

    @property
    def named(self) -> bool:
        """Whether that is enough to report it."""
        return self.supported and self.probability >= TRUSTED

    @property
    def grade(self) -> str:
        """How it is reported: without reservations, with it, or as one of a family that acts alike."""
        return "sure" if self.sure else "reserve" if self.named else "family"

    @property
    def supported(self) -> bool:
        """Whether the log excludes that it is nothing at all."""
        return self.signs["unsupported"] < 1.0

    @property
    def closes(self) -> bool:
        """Whether the set that it belongs to closes more of the gap than it leaves, on held-out runs."""
        return self.supported and self.signs["unclosed_of_gap"] <= 0.5

    @property
    def sure(self) -> bool:
        """Whether it is enough to report it without reservations."""
        return self.of_its_own and self.sized and self.probability >= SURE


def trust(
    competition: Competition, outcome: Outcome, part_of: Mapping[str, float], classes: Mapping[str, Sequence[str]]
) -> dict[str, Trust]:
    """Return the evidence for each name of the best hypothesis."""
    from scipy.special import expit

    found, weights = {}, ALONE if len(outcome.best.fit.spec) == 1 else BESIDE
    back = {} if competition.evidence.exact else taken_back(competition, outcome.best)
    silent = silenced(competition, outcome.best)
    for name, signs in signs_of(competition, outcome, part_of, classes).items():
        if name in back:
            signs = {**signs, "undone": max(signs["undone"], back[name] ** 0.5)}
        if name in silent:
            signs = {**signs, "unsupported": 1.0}
        score = weights["constant"] + sum(weight * signs[n] for n, weight in weights.items() if n != "constant")
        probability = float(expit(score))
        if not competition.evidence.exact:
            left = signs["left_where_it_acts"]
            halved = sqrt(left) <= TRUSTED
            probability = max(TRUSTED, 0.5 * (probability + 1.0 - left)) if halved else 0.5 * (1.0 - left)
        # In such a model no small further cause is told from what the forms of the others lack, nor one that they undo:
        # then two wrong forms may differ by the right one.
        small, undone = signs["faint"] > -0.25 * log(OF_ITS_OWN), signs["undone"] ** 2 > 0.5  # of the sum of squares
        own = competition.evidence.exact or not (small or undone)
        found[name] = Trust(probability, signs, own)
    return found

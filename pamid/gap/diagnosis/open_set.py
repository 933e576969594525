r"""Whether what was named is the cause, or only looks like it: what a name must show before it is said.

A cause that the library does not hold is mostly imitated by one or several effects of it, with a high likelihood. It is
given away by what the imitation leaves above the noise and the inexactness that its forms are allowed, and by effects
that undo or mend each other. These signs are weighed by logistic regression,

.. math:: p = \frac{1}{1 + \exp(-(c_0 + \sum_i c_i s_i))}

fitted to logs of benches whose cause is in the library and of ones whose cause is not. A name is said where it is more
likely right than not, and with reserve (this effect, or something that looks like it on this log) unless p is above the
bar at which at most one in twenty of the names said on such logs is wrong.

References
----------
A. N. Angelopoulos, S. Bates, A. Fisch, L. Lei, T. Schuster, "Conformal risk control", ICLR 2024.
https://doi.org/10.48550/arXiv.2208.02814
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..inference.competition import Competition
from ..inference.hypotheses import Outcome
from .signs import signs_of
from .trusted import SIGNS, SURE, TRUSTED


@dataclass(frozen=True)
class Trust:
    """What speaks for names being right.

    Parameters
    ----------
    probability : float
        Probability that they are.
    named : bool
        Whether that is enough to say them.
    sure : bool
        Whether it is enough to say them without reserve.
    signs : dict of str to float
        What it rests on, see `signs_of`.
    """

    probability: float
    named: bool
    sure: bool
    signs: dict[str, float]


def trust(competition: Competition, outcome: Outcome, part_of: Mapping[str, float], given_up: bool = False) -> Trust:
    """Return what speaks for the names of the best hypothesis.

    Parameters
    ----------
    competition : Competition
        The library on the log.
    outcome : Outcome
        Its hypotheses.
    part_of : mapping of str to float
        Each cause's share of what all explain together.
    given_up : bool, default=False
        Whether a cause beside these was given up.
    """
    signs = signs_of(competition, outcome, part_of, given_up)
    if not competition.evidence.exact:
        # Any other model may be wrong in several small ways at once: names are said of what they close.
        closed = 1.0 - signs["left_of_gap"]
        return Trust(closed, closed > TRUSTED, closed > SURE, signs)
    score = SIGNS["constant"] + sum(weight * signs[name] for name, weight in SIGNS.items() if name != "constant")
    probability = float(1.0 / (1.0 + np.exp(-score)))
    return Trust(probability, probability >= TRUSTED, probability >= SURE, signs)

r"""What a cause changes that the causes beside it take back: then they stand together for something else.

A constant voltage that is missing in one equation may be told as an offset of a reading, if a second offset cancels
what the first one does to another equation. Such a pair explains a log as well as a cause of a single equation, and no
part of it is established. Of what a cause changes in an equation, d, the others, o, take back

.. math:: 1 - \lVert d + o \rVert^2 / \lVert d \rVert^2

which is one where they cancel it, and half or less where they are less than a third of it, or much more.
"""

from __future__ import annotations

import numpy as np

from ..inference.competition import Competition
from ..inference.hypotheses import Hypothesis
from ..settings import LEAST_GAIN


def taken_back(competition: Competition, best: Hypothesis) -> dict[str, float]:
    """Return the largest share of what each cause changes in an equation, beyond the noise, that the others cancel."""
    evidence, found = competition.evidence, dict.fromkeys(best.fit.spec, 0.0)
    changes, J = competition.discrepancy.whole(best.fit), evidence.slopes(best.fit.spec, best.fit.x)
    for part, scale, weight in zip(evidence.parts, best.fit.scales, evidence.weights, strict=True):
        # Beyond what tolerances could do there: over all equations together they would bring in those of others.
        own = {name: _beyond(d[part], J[part]) for name, d in changes.items()}
        left = np.sum(list(own.values()), axis=0)
        for name, d in own.items():
            if 0.5 * weight * (power := float(d @ d)) > LEAST_GAIN * scale**2:  # otherwise its absence would not show
                found[name] = max(found[name], 1.0 - float(left @ left) / power)
    return found


def _beyond(d: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return what no combination of some columns explains."""
    return np.asarray(d - J @ np.linalg.lstsq(J, d, rcond=None)[0]) if J.size else d

r"""Whether the runs of one log disagree about the size of an effect: then they are not runs of one and the same system.

With the best template of each effect cut at a border between two runs, so that each side has a coefficient of its own,

.. math:: \ell_2 - \ell_S > \text{margins of first order}

for the best set S whose sizes all runs share.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..settings import CLOSE, CLOSE_SHARE, KEPT
from .first_order import FirstOrder
from .hypotheses import Screen
from .sensitivity import Template


class RunsDifferError(Exception):
    """The runs of a log disagree about the size of an effect."""


def runs_differ(first: FirstOrder, screen: Screen, odds: float) -> bool:
    """Return whether one effect with its own size before and after a run beats every set that all runs share."""
    if screen.about is None:
        return False
    nothing, borders = screen.about.fit(()), np.unique(first.evidence.run)[1:]
    best = max((s.score for s in screen.contenders), default=nothing.score)
    cut = list(_cut(first, borders))
    about = first.about_nothing(cut)
    for t in np.argsort(-about.gains(about.fit(())), kind="stable")[:KEPT]:
        subset = about.fit((int(t),))
        found = subset.score - about.cost[cut[int(t)].effect] + odds  # a size more, and the change itself
        if found > best + CLOSE + CLOSE_SHARE * max(found - nothing.score, 0.0):
            return True
    return False


def _cut(first: FirstOrder, borders: np.ndarray) -> Iterator[Template]:
    """Yield each effect at the point of its grid that explains most if cut at a border."""
    evidence, best = first.evidence, dict[str, tuple[float, Template]]()
    root = np.sqrt(first.base.weights)
    for template in first.templates:
        for border in borders:
            after = (evidence.run >= border)[:, None]
            columns = np.column_stack([template.columns * ~after, template.columns * after])
            A = columns * root[:, None]
            b = A.T @ (evidence.z0 * root)
            gain = float(b @ np.linalg.pinv(A.T @ A, rcond=1e-9) @ b)
            if gain > best.get(template.effect, (0.0, None))[0]:
                lower, upper = np.tile(template.lower, 2), np.tile(template.upper, 2)
                best[template.effect] = gain, replace(template, columns=columns, lower=lower, upper=upper)
    yield from (template for _, template in best.values())

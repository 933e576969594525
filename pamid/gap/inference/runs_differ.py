r"""Whether the runs of one log, or the two parts of one, disagree about the size of an effect.

Then they are not of one and the same system: an effect came, went or changed. With the best template of each effect cut
at a border between two runs, or at a window, so that each side has a coefficient of its own,

.. math:: \ell_2 - \ell_S > \text{margins of first order}

for the best set S whose sizes are the same all along. Each border costs the logarithm of how many there are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from ..residuals.protocol import ResidualSource
from ..settings import CLOSE, CLOSE_SHARE, FEWEST, KEPT
from .first_order import FirstOrder
from .hypotheses import Screen
from .sensitivity import Template


class Border(NamedTuple):
    """Where a log is cut in two: between two runs, within one, or at one time of each."""

    run: str
    """Name of the first run after it, or of the run that it divides; empty where it divides each."""
    time: float | None = None
    """Where it divides a run, s from its beginning; None between runs."""


class RunsDifferError(Exception):
    """The two sides of a border in a log disagree about the size of an effect."""

    def __init__(self, border: Border) -> None:
        super().__init__(border)
        self.border = border


def runs_differ(first: FirstOrder, screen: Screen, odds: Callable[[int], float]) -> Border | None:
    """Return the border at which one effect with two sizes beats every set with one; None where none does.

    `odds` are the log odds with which an effect acts on one side only of one of so many borders.
    """
    if screen.about is None:
        return None
    first.say("look for a change of an effect between runs or within them")
    nothing = screen.about.fit(())
    best = max((s.score for s in screen.contenders), default=nothing.score)
    for borders, passed in _borders(first.evidence):
        cut = list(_cut(first, passed, len(borders)))
        about = first.about_nothing([_in_two(template, passed > k) for template, k in cut])
        for t in np.argsort(-about.gains(about.fit(())), kind="stable")[:KEPT]:
            template, k = cut[int(t)]
            # A size more, and the change itself.
            found = about.fit((int(t),)).score - about.cost[template.effect] + odds(len(borders))
            if found > best + CLOSE + CLOSE_SHARE * max(found - nothing.score, 0.0):
                near = range(max(k - FEWEST, 0), min(k + FEWEST, len(borders) - 1) + 1)
                about = first.about_nothing([_in_two(template, passed > j) for j in near])
                return borders[near[int(np.argmax([about.fit((i,)).score for i in range(len(near))]))]]
    return None


def _borders(evidence: ResidualSource) -> Iterator[tuple[list[Border], np.ndarray]]:
    """Yield borders between runs, within one, and at a time of each, with how many of them each window has passed."""
    names, runs = evidence.trajectories, np.unique(evidence.run)[1:]
    if len(runs):
        yield [Border(names[k]) for k in runs], np.searchsorted(runs, evidence.run, side="right")
    instants, order = np.unique(np.stack([evidence.run, evidence.time]), axis=1, return_inverse=True)
    inside = [k for k in range(FEWEST, instants.shape[1] - FEWEST) if instants[0, k] == instants[0, k - 1]]
    if inside:
        middle = [0.5 * (instants[1, k - 1] + instants[1, k]) for k in inside]
        borders = [Border(names[int(instants[0, k])], float(t)) for k, t in zip(inside, middle, strict=True)]
        yield borders, np.searchsorted(inside, order.ravel(), side="right")
    times = np.unique(evidence.time)[FEWEST:-FEWEST]
    if len(runs) and len(times):
        yield [Border("", float(t)) for t in times], np.searchsorted(times, evidence.time, side="right")


def _cut(first: FirstOrder, passed: np.ndarray, count: int) -> Iterator[tuple[Template, int]]:
    """Yield each effect at the point of its grid, and the border, where it explains most if cut, and that border."""
    evidence, best = first.evidence, dict[str, tuple[float, Template, int]]()
    # Not weighted as nothing but noise would be: what follows a change are no outliers.
    sizes = [part.stop - part.start for part in evidence.parts]
    root = np.sqrt(np.repeat(first.fitter.weights, sizes))
    between = csr_array((np.ones(len(passed)), (passed, np.arange(len(passed)))), shape=(count + 1, len(passed)))
    for template in first.templates:
        A = template.columns * root[:, None]
        squares = (A[:, :, None] * A[:, None, :]).reshape(len(A), -1)
        products = np.column_stack([A * (evidence.z0 * root)[:, None], squares])
        before, k = np.cumsum(between @ products, axis=0), A.shape[1]
        before, whole = before[:-1], before[-1]
        ridge = 1e-9 * np.trace(whole[k:].reshape(k, k)) + 1e-300
        gain = sum((_gain(side, k, ridge) for side in (before, whole - before)), np.zeros(count))
        top = int(np.argmax(gain))
        if gain[top] > best.get(template.effect, (0.0, None, 0))[0]:
            best[template.effect] = float(gain[top]), template, top
    yield from ((template, top) for _, template, top in best.values())


def _in_two(template: Template, after: np.ndarray) -> Template:
    """Return an effect with a size of its own on each side of a border."""
    columns = np.column_stack([template.columns * ~after[:, None], template.columns * after[:, None]])
    return replace(template, columns=columns, lower=np.tile(template.lower, 2), upper=np.tile(template.upper, 2))


def _gain(products: np.ndarray, k: int, ridge: float) -> np.ndarray:
    """Return what k columns explain on one side of each border."""
    b, G = products[:, :k], products[:, k:].reshape(-1, k, k)
    x = np.linalg.solve(G + ridge * np.eye(k), b[..., None])[..., 0]
    return np.asarray(np.sum(b * x, axis=1))

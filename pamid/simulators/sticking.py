r"""What holds a motion at rest, by its value at the end of each step: it turns over within less than the way of a step.

Dry friction turns over within microns. Taken along a step as it was at the beginning, it throws a joint that should
rest to and fro. With the value :math:`f` that it has at the end, for the bristles that the speed there bends,

.. math:: f = F(x), \qquad x = x_0 + (1 - s)\left[(1 - s)\,G + s\,h B\right] (f - f_0),

the joint stops, and stays. Under the force of the beginning, :math:`f_0`, a step leads to :math:`x_0`, and the motion
turns after a share :math:`s` of it; from there on :math:`f` acts. G is how the states respond to a force that acts all
the step of h, B how their rates do. As the force opposes the speed, it has one such value, between none and that of the
motion without it.

References
----------
P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976. https://doi.org/10.2514/3.61511;
J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics", Nonsmooth Mechanics and Applications,
Springer, 1988, for forces at the end of a step. https://doi.org/10.1007/978-3-7091-2624-0_1
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

_ROUNDS = 80
"""Most evaluations of a force while its value is looked for."""
_SWEEPS = 30
"""Most times that each force is found beside the others."""
_EXACT = 1e-13
"""Share of a force that its value may miss."""
_FIRST = 1.0, 6.0
"""First guesses beyond rest, in distances within which the force turns over."""

Forces = Sequence[np.ndarray]
Some = slice | np.ndarray
ALL = slice(None)
AtEnd = Callable[[np.ndarray, Some], tuple[np.ndarray, np.ndarray]]


class Hold(NamedTuple):
    """A force that holds a motion, in one step of runs side by side."""

    begun: np.ndarray
    """The force at the beginning, shape (n_runs,)."""
    way: np.ndarray
    """How far the speed at the beginning leads in a step, shape (n_runs,)."""
    within: float
    """Distance within which it turns over."""
    small: float
    """A small force for the simulator."""
    at_end: AtEnd
    """The force at the end, and how far the speed there leads in a step, by the states there of some of the runs."""


def settled(run: Callable[[Forces], tuple[np.ndarray, np.ndarray]], holds: Sequence[Hold], h: float) -> np.ndarray:
    """Return the states at the end of a step of h.

    `run` returns the states at the end, and the rates at the beginning, under constant forces.
    """
    begun = [hold.begun for hold in holds]
    base, rates = run(begun)
    slopes, found = [], list(begun)
    for k, hold in enumerate(holds):
        there, pushed = run([*begun[:k], begun[k] + hold.small, *begun[k + 1 :]])
        share = _turned(hold.way, hold.at_end(base, ALL)[1])
        whole, at_once = (there - base) / hold.small, h * (pushed - rates) / hold.small
        slopes.append((1.0 - share) * ((1.0 - share) * whole + share * at_once))
    states = base
    for _ in range(_SWEEPS):
        far = 0.0
        for k, (hold, slope) in enumerate(zip(holds, slopes, strict=True)):
            without, before = states - slope * found[k], found[k]

            def at_end(f: np.ndarray, some: Some) -> tuple[np.ndarray, np.ndarray]:
                return hold.at_end(without[:, some] + slope[:, some] * f, some)  # noqa: B023 - used in this round

            found[k] = _root(at_end, hold.within)
            states = without + slope * found[k]
            size = float(np.max(np.abs(found[k]), initial=0.0))
            far = max(far, float(np.max(np.abs(found[k] - before), initial=0.0)) / (size or 1.0))
        if len(holds) == 1 or not far > _EXACT:
            break
    return states


def _turned(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the share of a step after which a speed that changes evenly has turned; 0 where it does not."""
    with np.errstate(all="ignore"):
        return np.where(start * end < 0.0, start / (start - end), 0.0)


def _root(at_end: AtEnd, within: float) -> np.ndarray:
    """Return the force that follows from itself, by the Illinois method from where nothing moves."""
    top, free = at_end(np.zeros(()), ALL)
    full, slid = at_end(top, ALL)
    behind = full - top
    slides = (np.sign(behind) != -np.sign(top)) | ~np.isfinite(behind)
    if slides.all():
        return top
    with np.errstate(all="ignore"):
        slope = (slid - free) / top
        rest, turn = -free / slope, within / slope * np.sign(top)
    rest = np.clip(np.where(np.isfinite(rest), rest, 0.0), np.minimum(top, 0.0), np.maximum(top, 0.0))
    off = at_end(rest, ALL)[0] - rest
    more = off * top > 0.0
    a, ahead = np.where(more, rest, 0.0), np.where(more, off, top)
    b, behind = np.where(more, top, rest), np.where(more, behind, off)
    # What slides does so whatever other runs do beside it.
    found, some = np.where(slides, top, np.where(off == 0.0, rest, b)), np.flatnonzero(~slides & (off != 0.0))
    # What has been found is not asked for again: most runs slide in most steps.
    rows = a, ahead, b, behind, rest, np.where(more, 1.0, -1.0) * turn, _EXACT * np.abs(top)
    a, ahead, b, behind, rest, turn, exact = (row[some] for row in rows)
    for k in range(_ROUNDS):
        open_ = (np.abs(b - a) > exact) & (np.abs(behind) > exact)
        if not open_.all():
            found[some], some = b, some[open_]
            rows = a, ahead, b, behind, rest, turn, exact
            a, ahead, b, behind, rest, turn, exact = (row[open_] for row in rows)
        if not len(some):
            break
        with np.errstate(all="ignore"):
            c = b - behind * (b - a) / (behind - ahead)
        if k < len(_FIRST):
            near = rest + _FIRST[k] * turn
            c = np.where((near - a) * (near - b) < 0.0, near, c)
        elif k % 4 == 3:
            c = 0.5 * (a + b)
        off = at_end(c, some if len(some) < len(found) else ALL)[0] - c
        over = np.sign(off) == np.sign(behind)
        a, ahead = np.where(over, a, b), np.where(over, 0.5 * ahead, behind)
        b, behind = c, off
    found[some] = b
    return found

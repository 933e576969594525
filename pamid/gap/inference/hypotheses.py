"""Hypotheses: sets of effects with their evidence, from the screening of the library to the outcome."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...effects import Effect
from ..residuals.protocol import Spec
from ..settings import CLOSE, CLOSE_SHARE, KEPT
from .gauss_newton import Fit
from .subsets import Subset, Subsets


@dataclass
class Hypothesis:
    """A set of effects, refitted, with its evidence."""

    fit: Fit
    """Tolerances and effects refitted."""
    score: float
    """Logarithm of its evidence: the likelihood with model discrepancy, less the price of its parameters."""
    plain: float
    """The likelihood with the forms as they are."""
    left: np.ndarray
    """Scale of the residuals, in units of noise and discrepancy; may be less than 1. Shape (n_equations,)."""
    z: np.ndarray
    """What is left, in the same units. Shape (n_windows,)."""
    weights: np.ndarray
    """Weight of each window at the fit, shape (n_windows,)."""
    own: list[float] | None = None
    """How large each of several effects is beside what the others leave open; None until computed."""

    @property
    def names(self) -> frozenset[str]:
        """Its effects."""
        return frozenset(self.fit.spec)


class Single(NamedTuple):
    """An effect by itself."""

    gain: float
    """Gain in log-likelihood less the effect's price; to first order where it was not refitted."""
    closed: float
    """Share of the excess over the noise, of all equations together, that it closes; to first order where it was not
    refitted."""


@dataclass
class Outcome:
    """The outcome of the competition."""

    base: Hypothesis
    best: Hypothesis
    """No effect, and the set with the highest score."""
    singles: dict[str, Single]
    """What each effect explains by itself."""
    alternatives: dict[str, list[Hypothesis]] = field(default_factory=dict)
    """For each effect of the best set the same set with another effect in its place, itself among them, the highest
    score first."""
    refitted: list[Hypothesis] = field(default_factory=list)
    """All sets that were refitted, the highest score first."""
    unseen: Callable[[Callable[[Spec], bool]], bool] = field(default_factory=lambda: lambda hides: False)
    """Returns whether runs show what holds a motion, where the equations prefer another cause, told whether noise hides
    a set of effects there; takes some runs."""


class Screen(NamedTuple):
    """The library to first order."""

    about: Subsets | None
    """Its sets about no effect; None where nothing of it changes the residuals."""
    singles: dict[str, Single]
    """What each effect explains by itself."""
    contenders: list[Subset]
    """The sets that are worth an exact refit, small ones first."""


def contenders(found: Sequence[Subset], nothing: float) -> list[Subset]:
    """Return the sets to refit, small ones first: those close to the best, and the best two of one and two effects."""
    some = [s for s in found if s.templates]
    if not some:
        return []
    best = some[0].score
    chosen: list[Subset] = []
    for s in some:
        if s.score < best - CLOSE - CLOSE_SHARE * max(best - nothing, 0.0) or len(chosen) == KEPT:
            break
        if not any(set(c.templates) < set(s.templates) for c in chosen):
            chosen.append(s)
    few = [s for n in (1, 2) for s in [s for s in some if len(s.templates) == n and s not in chosen][:2]]
    return sorted([*chosen, *few], key=lambda s: (len(s.templates), -s.score))


ALMOST = 0.1
"""Share of the others below which a part that an effect is about is not there."""
AT_BOUND = 0.02
"""How near to a bound a parameter is at it, as a share; a bound below that share of a typical value means zero."""


def degenerate(effect: Effect, seconds: float) -> bool:
    """Return whether a fitted effect has turned into another one, on runs of at most so many seconds."""
    values, parameters = effect.values, effect.parameters
    if effect.elastic(seconds):
        return True
    pairs = [(values[p.name], values[p.unlike]) for p in parameters if p.unlike]
    if pairs and all(abs(a - b) <= ALMOST * max(abs(a), abs(b)) for a, b in pairs):
        return True
    for p in parameters:
        value = values[p.name]
        if p.simplest and value <= (1.0 + AT_BOUND) * p.lower:
            return True
        if not p.essential:
            continue
        if p.linear:
            alike = (abs(values[q.name]) for q in parameters if q.linear and q.unit == p.unit and q is not p)
            if abs(value) <= ALMOST * max(alike, default=0.0):
                return True
        # A lower bound far below typical values means zero, the ideal form of the same effect.
        elif value >= (1.0 - AT_BOUND) * p.upper or (
            p.lower > AT_BOUND * p.nominal and value <= (1.0 + AT_BOUND) * p.lower
        ):
            return True
    return False

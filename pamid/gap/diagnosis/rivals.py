"""The explanations of a log that are not ruled out, for a further run to separate."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ..inference.competition import Competition
from ..inference.hypotheses import Hypothesis
from ..settings import CLASS, CLASS_SHARE, DECIDED
from .decide import Verdict

MOST = 6
"""Most explanations that are kept."""
LEAST_RIVALS = 3
"""Explanations that are kept of a gap without a name, however far apart they are."""


@dataclass(frozen=True)
class Rival:
    """One explanation of a log, refitted."""

    effects: Mapping[str, Mapping[str, float]]
    """Its effects with their values; empty for a simulator that needs none."""
    deviations: Mapping[str, float]
    """How far the parameters with a tolerance were refitted with it, in tolerances."""
    score: float
    """Logarithm of its evidence."""
    belief: float
    """Probability among the explanations that are kept."""

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects."""
        return tuple(self.effects)

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and text."""
        return {
            "effects": {name: {k: float(v) for k, v in values.items()} for name, values in self.effects.items()},
            "deviations": {name: float(v) for name, v in self.deviations.items()},
            "score": float(self.score),
            "belief": float(self.belief),
        }

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> Self:
        """Return an explanation that was written as plain numbers and text."""
        effects = {str(k): {str(p): float(v) for p, v in values.items()} for k, values in found["effects"].items()}
        deviations = {str(k): float(v) for k, v in found["deviations"].items()}
        return cls(effects, deviations, float(found["score"]), float(found["belief"]))


def rivals_of(competition: Competition, verdict: Verdict) -> list[Rival]:
    """Return the explanations that are not ruled out, the likeliest first."""
    outcome, best = verdict.outcome, verdict.outcome.best
    standing = [h for h in [outcome.base, *outcome.refitted] if _stands(competition, h, verdict)]
    scored = {h.names: (competition.comparable(h), h) for h in standing}
    scored[best.names] = (competition.comparable(best), best)
    ranked = sorted(scored.values(), key=lambda s: (s[1] is not best, -s[0]))
    gain = max(best.score - outcome.base.score, 0.0)
    top = ranked[0][0]
    kept = [s for s in ranked if s[0] > top - DECIDED][:MOST]
    if verdict.kind == "unknown" and len(kept) < LEAST_RIVALS:
        kept = ranked[:LEAST_RIVALS]
    width = CLASS + CLASS_SHARE * gain
    odds = np.exp(np.clip(np.array([min(s - top, 0.0) for s, _ in kept]) / width, -30.0, 0.0))
    return [
        Rival(
            {k: dict(v) for k, v in h.fit.spec.items()},
            dict(zip(competition.evidence.free, map(float, h.fit.x), strict=True)),
            float(s),
            float(w),
        )
        for (s, h), w in zip(kept, odds / odds.sum(), strict=True)
    ]


def _stands(competition: Competition, h: Hypothesis, verdict: Verdict) -> bool:
    """Return whether a set is a distinct explanation: not degenerate, and without effects that add nothing."""
    best = verdict.outcome.best
    more = h.names > best.names and (verdict.named or h.score < best.score)
    return not more and not any(competition.degenerate(h.fit, name) for name in h.names)

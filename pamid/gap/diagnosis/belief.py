"""How probability is shared among the effects of the library, no gap, and a cause outside the library."""

import numpy as np

from ..inference.competition import Competition
from ..settings import FALSE_ALARM, INCLUDED, NONE_SURE
from .decide import Verdict
from .findings import Candidate

_NOISE = "explains no more than noise would"


def candidates(competition: Competition, verdict: Verdict) -> list[Candidate]:
    """Return the whole library with the evidence for each name, confidences adding to one."""
    outcome = verdict.outcome
    named = list(outcome.best.fit.spec) if verdict.named and verdict.kind != "family" else []
    belief = _belief(verdict, named)
    scores = {name: single.gain for name, single in outcome.singles.items()}
    closed = {name: single.closed for name, single in outcome.singles.items()}
    if len(named) == 1:
        scores[named[0]] = outcome.best.score - outcome.base.score
    rest = max(0.0, 1.0 - sum(belief.values()))
    others = {n: s for n, s in scores.items() if n not in belief}
    if others and rest > 0:
        top = max(others.values())
        odds = {n: float(np.exp(max(s - top, -50.0) / 3.0)) for n, s in others.items()}
        belief.update({n: rest * v / sum(odds.values()) for n, v in odds.items()})
    total = sum(belief.values()) or 1.0
    best = max(scores.values(), default=0.0)
    rows = []
    for name in {**scores, **dict.fromkeys(("none", "unknown"))}:
        sure = belief.get(name, 0.0) / total
        reason = ""
        if name in scores and name not in named and sure <= 1.0 - INCLUDED:
            reason = _reason(competition, verdict, scores[name], best)
        if named and name in verdict.trust and name not in named:
            reason = "fits together with the named causes, but more likely compensates for their inexact forms"
        share = 0.0 if reason == _NOISE else closed.get(name, 0.0)  # noise closes nothing
        rows.append(Candidate(name, sure, float(scores.get(name, 0.0)), share, reason))
    untouched = [n for n in competition.library if n not in scores]
    rows += [
        Candidate(n, 0.0, 0.0, 0.0, "changes no equation that this log can test, or has nothing in the log to act on")
        for n in untouched
    ]
    # Causes come first in the order of the verdict; several of them may each be certain.
    place = {name: k for k, name in enumerate(sorted(named, key=lambda n: -verdict.part_of.get(n, 1.0)))}
    return sorted(rows, key=lambda c: (-c.confidence, place.get(c.effect, 99), -c.score))


def _belief(verdict: Verdict, named: list[str]) -> dict[str, float]:
    if verdict.kind == "none":
        calm = float(np.clip(np.log10(max(verdict.p_value, 1e-9) / FALSE_ALARM), 0.0, 1.0))
        none = 0.5 + (NONE_SURE - 0.5) * calm
        return {"none": none, "unknown": 0.3 * (1.0 - none)}
    # Where nothing is named, the names of the best hypothesis may be right after all.
    belief = {"unknown": verdict.unknown, "none": min(0.5, verdict.p_value)}
    for name, lead in verdict.leads.items():
        for other, w in verdict.weights[name].items():
            if other not in named or other == name:
                belief[other] = belief.get(other, 0.0) + lead * w * verdict.trust[name].probability
    return belief


def _reason(competition: Competition, verdict: Verdict, score: float, best: float) -> str:
    if score < competition.evidence.least_gain:
        return _NOISE
    if verdict.kind in ("unknown", "family") and score >= best:
        return "comes closest, but leaves a larger error than a slightly wrong formula would explain"
    if score < best:
        return f"explains less: its log-likelihood is lower by {best - score:.0f}"
    return "explains a part of the gap that a set of other causes explains better"

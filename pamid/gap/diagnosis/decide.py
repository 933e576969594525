"""From competing hypotheses to an answer: no gap, one cause, a class, several causes, or an unknown one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..inference.competition import Competition
from ..inference.hypotheses import Hypothesis, Outcome
from ..inference.sensitivity import Template
from ..inference.significance import Excess, excess, library_test, outliers
from ..inference.student_t import loglik
from ..residuals.protocol import ResidualSource
from ..residuals.tolerances import SMALL
from ..settings import CLASS, CLASS_SHARE, EXCESS, FALSE_ALARM, INCLUDED
from .closure import shapley
from .open_set import Trust, trust


@dataclass
class Verdict:
    """The decision after the competition of hypotheses."""

    kind: str
    """One of `pamid.gap.diagnosis.result.VERDICTS`, or ``"family"``: what closes the gap acts like effects of the
    library, but none of them is established."""
    p_value: float
    """Probability of the evidence without a gap."""
    outcome: Outcome
    """The hypotheses."""
    excess: list[Excess]
    """The excess of each equation's residual over its noise, before."""
    beyond: float = 1.0
    """Probability of residuals as large without a gap."""
    trust: dict[str, Trust] = field(default_factory=dict)
    """Evidence for each name of the best set, whether reported or not; empty where there is none."""
    classes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """For each cause the names that cannot be distinguished from it, itself first."""
    weights: dict[str, dict[str, float]] = field(default_factory=dict)
    """For each cause the share of belief of each alternative."""
    part_of: dict[str, float] = field(default_factory=dict)
    """For each cause its share of the joint gain."""

    @property
    def named(self) -> bool:
        """Whether causes are named."""
        return self.kind in ("cause", "class", "several", "family")

    @property
    def rests_on_size(self) -> bool:
        """Whether no residual exceeds its noise: then only the sizes of causes show that there is a gap."""
        return self.beyond >= FALSE_ALARM

    def without_gap(self) -> Verdict:
        """Return that there is none, since the sizes of all causes may be none: 90 % intervals include it."""
        return replace(self, kind="none", p_value=max(self.p_value, 0.1))

    @property
    def reserved(self) -> bool:
        """Whether some named causes may only look like the cause: one beyond the library is not excluded."""
        return self.named and not all(self.trust[name].sure for name in self.outcome.best.names)

    @property
    def unknown(self) -> float:
        """Probability that most of a gap has a cause outside the library."""
        if self.kind == "none":
            return 0.0
        leads = self.leads
        return 1.0 - sum(lead * self.trust[name].probability for name, lead in leads.items())

    @property
    def leads(self) -> dict[str, float]:
        """Probability that each cause is the leading one, from its share of the joint gain."""
        weight = {n: max(self.part_of.get(n, 1.0), 0.02) ** 1.5 for n in self.outcome.best.fit.spec if n in self.trust}
        return {name: w / sum(weight.values()) for name, w in weight.items()}


def decide(competition: Competition, outcome: Outcome, random_state: np.random.RandomState) -> Verdict:
    """Decide between no gap, named causes and a cause outside the library."""
    evidence, base, best = competition.evidence, outcome.base, outcome.best
    over = [excess(evidence, base.fit.z, part, s) for part, s in zip(evidence.parts, base.left, strict=True)]
    beyond = min([min(1.0, len(over) * e.p_value) for e in over if e.scale > 1.0 + EXCESS] or [1.0])
    beyond = min(beyond, outliers(evidence, base.fit.z))
    test = library_test(evidence, base.fit, _judged(competition), random_state)
    gain = best.score - base.score - within_noise(competition, base, best)
    chance = test.p_value
    if gain > evidence.decisive:  # such evidence needs no draws where noise is independent
        chance = min(chance, float(np.exp(-gain - 1.0)))
    elif gain <= evidence.least_gain:
        # Where no hypothesis survives an exact fit, draws of the linear ones add no evidence.
        chance = max(chance, min(1.0, FALSE_ALARM * float(np.exp(evidence.least_gain - max(gain, 0.0)))))
    # What closes no more than the noise hides is no cause: the noise may be estimated too large.
    closes = bool(np.any((base.left > 1.0 - EXCESS) & (best.left < base.left)))
    verdict = Verdict("none", min(1.0, 2.0 * min(chance if closes else 1.0, beyond)), outcome, over, beyond)
    # A residual beyond its noise is a gap by itself: a cause that acts in few rows need not prove it again.
    a_gap = closes and min(chance, beyond) < FALSE_ALARM
    if a_gap and best.fit.spec and gain > evidence.least_gain:
        verdict.part_of = shapley(competition.fitter, base.fit, best.fit)
        for name in best.fit.spec:
            about = competition.gain_about(best, name)
            verdict.weights[name] = _weights(outcome.alternatives[name], best, name, about, evidence)
            verdict.classes[name] = _class(verdict.weights[name], name)
        verdict.trust = trust(competition, outcome, verdict.part_of, verdict.classes)
        named = _standing(verdict, competition)
        shown = beyond < FALSE_ALARM or any(found.supported for found in verdict.trust.values())
        alike = not named and all(found.closes for found in verdict.trust.values())
        verdict.kind = kind_of(verdict, named) if named else "family" if alike else "unknown" if shown else "none"
        if named and len(named) < len(best.fit.spec):
            # What is not trusted is left to the remainder: it may compensate the form of other causes.
            verdict.outcome, verdict.part_of = _only(verdict, competition, named)
    elif beyond < FALSE_ALARM:
        verdict.kind = "unknown"
    return verdict


def within_noise(competition: Competition, base: Hypothesis, best: Hypothesis) -> float:
    """Return the gain in equations that leave less than their noise without causes: there is nothing to explain."""
    weights = competition.fitter.weights
    quiet = [k for k, left in enumerate(base.left) if left <= 1.0 - EXCESS]
    parts = [competition.evidence.parts[k] for k in quiet]
    there, before = (loglik(h.fit.z, parts, weights[quiet])[0] for h in (best, base))
    return max(there - before, 0.0)


def _judged(competition: Competition) -> Iterator[Template]:
    """Yield the templates that noise alone does not resemble: a gain undone in a reading scales its noise, too."""
    alike: dict[str, bool] = {}
    for t in competition.templates:
        if t.effect not in alike:
            alike[t.effect] = competition.evidence.scales_noise({t.effect: t.starts(np.full(len(t.lower), SMALL))[0]})
        if not alike[t.effect]:
            yield t


def _standing(verdict: Verdict, competition: Competition) -> list[str]:
    """Return the trusted causes, also without the others; a cause that only stands beside an untrusted one is none."""
    named = [name for name in verdict.outcome.best.fit.spec if verdict.trust[name].named]
    while named and len(named) < len(verdict.outcome.best.fit.spec) and not competition.evidence.exact:
        found = trust(competition, *_only(verdict, competition, named), verdict.classes)
        fallen = {name: found[name] for name in named if not found[name].named}
        if not fallen:
            break
        verdict.trust |= fallen
        named = [name for name in named if name not in fallen]
    return named


def _only(verdict: Verdict, competition: Competition, named: Sequence[str]) -> tuple[Outcome, dict[str, float]]:
    """Return the outcome for some of the causes, and their shares of the joint gain."""
    outcome = competition.only(verdict.outcome, {name: verdict.classes[name] for name in named})
    return outcome, shapley(competition.fitter, outcome.base.fit, outcome.best.fit)


def kind_of(verdict: Verdict, names: Sequence[str]) -> str:
    """Return the verdict that names causes."""
    if len(names) > 1:
        return "several"
    return "class" if len(verdict.classes[names[0]]) > 1 else "cause"


def _weights(
    alternatives: Sequence[Hypothesis], best: Hypothesis, name: str, gain: float, evidence: ResidualSource
) -> dict[str, float]:
    """Return the probability of each alternative to a cause, allowing for its inexact form."""
    names = [next(iter(h.names - (best.names - {name}))) for h in alternatives]
    scores = np.array([h.score for h in alternatives])
    width = np.full(len(names), CLASS + CLASS_SHARE * max(gain, 0.0))
    width[[evidence.effects[n].extends == evidence.effects[name].name for n in names]] = 1.0
    w = np.exp((scores - scores.max()) / width)
    return dict(zip(names, (w / w.sum()).tolist(), strict=True))


def _class(weights: dict[str, float], name: str) -> tuple[str, ...]:
    """Return the smallest set of alternatives that holds the cause with 95 %, the likeliest first."""
    names = sorted(weights, key=lambda n: -weights[n])
    if name in names:
        names.remove(name)
        names.insert(0, name)
    total, chosen = 0.0, []
    for n in names:
        chosen.append(n)
        total += weights[n]
        if total >= INCLUDED:
            break
    return tuple(chosen)

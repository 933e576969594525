"""Results for each of several logs: parameters log by log, and causes that changed between logs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..diagnosis.decide import Verdict
from ..diagnosis.findings import Candidate, Cause, ParameterEstimate
from ..diagnosis.result import Diagnosis
from ..diagnosis.rivals import Rival
from ..inference.competition import Competition
from ..inference.gauss_newton import Fit
from ..inference.hypotheses import Hypothesis
from ..settings import INCLUDED
from .per_log import estimates, fitted_alone, main_parameter
from .result import Change, LogFinding
from .stacked import StackedEvidence
from .variants import Variants

Spec = dict[str, dict[str, float]]


def merged(
    found: Diagnosis, stack: StackedEvidence, competition: Competition, verdict: Verdict, variants: Variants
) -> Diagnosis:
    """Return a diagnosis in which an effect has one name, whichever logs it acts in, and each log its parameters."""
    best = verdict.outcome.best
    spec = {k: dict(v) for k, v in best.fit.spec.items()} if verdict.named else {}
    fits = [_of_log(stack, k, spec, best.fit.x, variants) for k in range(len(stack.logs))]
    logs = []
    for log, fit in zip(stack.logs, fits, strict=True):
        deviations = dict(zip(log.evidence.free, map(float, fit.x), strict=True))
        logs.append(LogFinding(log.name, log.day, 0, 0, {}, estimates(log.evidence, fit), deviations))
    parts = {(variants.plain(name), when[1]): name for name in spec if (when := variants.when(name)) is not None}
    changes = [_change(name, logs, competition, verdict, variants) for name in parts.values()]
    last = stack.logs[-1].evidence
    corrected = last.corrected(fits[-1].spec, dict(zip(last.free, map(float, fits[-1].x), strict=True)))
    x = stack.deviations_in(len(stack.logs) - 1, np.array([found.deviations.get(n, 0.0) for n in stack.free]))
    causes = _causes(found.causes, logs, variants)
    one = "class" if causes and len(causes[0].effects) > 1 else "cause"
    return replace(
        found,
        verdict=one if found.verdict == "several" and len(causes) == 1 else found.verdict,
        candidates=_candidates(found.candidates, variants),
        causes=causes,
        families=_causes(found.families, logs, variants),
        hypotheses=[
            replace(h, effects=tuple(dict.fromkeys(variants.plain(e) for e in h.effects))) for h in found.hypotheses
        ],
        cannot_show=[n for n in found.cannot_show if n == variants.plain(n)],
        logs=logs,
        changes=sorted(changes, key=lambda c: -c.evidence),
        nominal=last.deviated(dict(zip(last.free, map(float, x), strict=True))),
        corrected=corrected,
        rivals=_rivals(found.rivals, stack, variants),
    )


def _of_log(stack: StackedEvidence, k: int, spec: Spec, x: np.ndarray, variants: Variants) -> Fit:
    """Return the causes refitted to one log, those of one effect taken together."""
    joined: Spec = {}
    for name, values in spec.items():
        if not variants.acts(name, k):
            continue
        plain = variants.plain(name)
        # Two shares of one effect act as one: linear parameters add up, the larger share gives the form.
        joined[plain] = _together(stack, plain, joined[plain], values) if plain in joined else dict(values)
    return fitted_alone(stack.logs[k].evidence, joined, stack.deviations_in(k, x))


def _together(
    stack: StackedEvidence, effect: str, one: Mapping[str, float], two: Mapping[str, float]
) -> dict[str, float]:
    linear = {p.name: p for p in stack.effects[effect].parameters if p.linear}
    main = main_parameter(stack.effects[effect], one)
    form = one if abs(one[main]) >= abs(two[main]) else two
    total = {n: float(np.clip(one[n] + two[n], p.lower, p.upper)) for n, p in linear.items()}
    return {**form, **total}


def _change(
    name: str, logs: Sequence[LogFinding], competition: Competition, verdict: Verdict, variants: Variants
) -> Change:
    """Return how a cause changed that acts in some logs only."""
    when = variants.when(name)
    assert when is not None
    how, since = when
    plain = variants.plain(name)
    place = [f.log for f in logs].index(since)
    sides = logs[place - 1].parameters.get(plain), logs[place].parameters.get(plain)
    known = next(s for s in (*sides, *(f.parameters.get(plain) for f in logs)) if s is not None)
    values = {k: p.value for k, p in known.items()}
    main = main_parameter(variants.effects[plain], values)
    before, after = (s[main].value if s is not None else float("nan") for s in sides)
    if np.isfinite(before) and np.isfinite(after):
        how = "grows" if abs(after) > abs(before) else "shrinks"
    best = verdict.outcome.best
    score = _without_change(best, name, since, competition, variants)
    return Change(plain, how, since, before, after, main, known[main].unit, float(best.score - score))


def _without_change(best: Hypothesis, name: str, since: str, competition: Competition, variants: Variants) -> float:
    """Return the evidence of the same causes, one of them without its change at a border."""
    plain = variants.plain(name)
    spec = {
        k: dict(v)
        for k, v in best.fit.spec.items()
        if variants.plain(k) != plain or (variants.when(k) or ("", ""))[1] != since
    }
    spec.setdefault(plain, dict(best.fit.spec[name]))
    return competition.hypothesis(competition.fitter.refine(spec, near=best.fit.x)).score


def _candidates(candidates: Sequence[Candidate], variants: Variants) -> list[Candidate]:
    """Return each effect once, with the belief in all its forms."""
    found: dict[str, Candidate] = {}
    for c in candidates:
        name = variants.plain(c.effect)
        if name not in found:
            found[name] = replace(c, effect=name)
            continue
        first = found[name]
        found[name] = replace(
            first,
            confidence=first.confidence + c.confidence,
            score=max(first.score, c.score),
            closed_share=max(first.closed_share, c.closed_share),
        )
    out = [replace(c, ruled_out="" if c.confidence > 1.0 - INCLUDED else c.ruled_out) for c in found.values()]
    return sorted(out, key=lambda c: -c.confidence)  # a stable sort: causes of one belief keep their order


def _causes(causes: Sequence[Cause], logs: Sequence[LogFinding], variants: Variants) -> list[Cause]:
    """Return each cause once, its parameters those of all logs, or of the last in which it acts."""
    found: dict[str, Cause] = {}
    for cause in causes:
        each = _each(cause, variants)
        first = next(iter(each))
        if first in found:
            old = found[first]
            ci = (old.share_ci90[0] + cause.share_ci90[0], old.share_ci90[1] + cause.share_ci90[1])
            each = _each(old, variants) | {k: v for k, v in each.items() if k not in old.effects}
            last = next((f.parameters[first] for f in reversed(logs) if first in f.parameters), None)
            cause = replace(
                old,
                confidence=max(old.confidence, cause.confidence),
                share=min(old.share + cause.share, 1.0),
                share_ci90=(min(ci[0], 1.0), min(ci[1], 1.0)),
                parameters=last or old.parameters,
            )
        found[first] = replace(cause, effects=tuple(each), others=tuple(each.values())[1:])
    return sorted(found.values(), key=lambda c: -c.share)


def _each(cause: Cause, variants: Variants) -> dict[str, dict[str, ParameterEstimate]]:
    """Return the effects of a class, each once, with the parameters of its likeliest form."""
    found: dict[str, dict[str, ParameterEstimate]] = {}
    for name, parameters in zip(cause.effects, (cause.parameters, *cause.others), strict=True):
        found.setdefault(variants.plain(name), parameters)
    return found


def _rivals(rivals: Sequence[Rival], stack: StackedEvidence, variants: Variants) -> list[Rival]:
    """Return the explanations of the bench as it is now: the effects that act in the last log, each set once."""
    k, found = len(stack.logs) - 1, dict[frozenset[str], Rival]()
    for r in rivals:
        spec: Spec = {}
        for name, values in r.effects.items():
            if variants.acts(name, k):
                plain = variants.plain(name)
                spec[plain] = _together(stack, plain, spec[plain], values) if plain in spec else dict(values)
        x = stack.deviations_in(k, np.array([r.deviations[n] for n in stack.free]))
        known = found.get(frozenset(spec))
        if known is None:
            deviations = dict(zip(stack.logs[k].evidence.free, map(float, x), strict=True))
            found[frozenset(spec)] = Rival(spec, deviations, r.score, r.belief)
        else:
            found[frozenset(spec)] = replace(known, belief=known.belief + r.belief)
    return list(found.values())

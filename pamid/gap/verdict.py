"""From fits to an answer: is there a gap, is an effect its cause, a class, several, or none that is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from .evidence import AnyEvidence
from .fit import Fit, Fitter
from .search import CROSS, MAX_CAUSES, Rival, Search, Stage, has_form
from .significance import Excess, Significance, excess, library_test

FALSE_ALARM = 0.01
"""Probability at which the evidence of an effect or of an excess counts as a gap."""
LEAST_GAIN = 10.0
"""Gain in log-likelihood that an effect must bring at least; noise alone rarely brings five."""
AUDIBLE = 0.05
"""A further cause that is fainter in an equation than this share of one before may be an error of its form."""
CLOSES = 0.4
"""Share of what is left in an equation that a further cause must close."""
CLEAR = 1.5
"""Scale of what is left, in noise, up to which a cause may leave something unexplained …"""
FORM_LEFT = 0.04
"""… and the share of the scale before that comes on top, for its form."""
SHARE_LEFT = 0.4
"""Share of an equation's excess that may be left."""
SHARP = 8.0
"""How sharply doubt rises at those limits."""
DOUBT, DOUBT_SHARE = 2.0, 0.004
"""Difference in score that a candidate's form is worth: nats, and share of the gain."""


@dataclass
class Verdict:
    """What the search came to.

    Parameters
    ----------
    kind : str
        ``"cause"``, ``"class"``, ``"several"``, ``"unknown"`` or ``"none"``.
    p_value : float
        Probability of the evidence without a gap.
    fit : Fit
        The simulator refitted with the causes; without effects if there is none.
    base : Fit
        The simulator refitted without effects.
    rivals : dict of str to list of (Rival, float)
        For each cause its alternatives with their gains, itself among them, the best first.
    excess : list of Excess
        The residual of each equation before, against its noise.
    unknown : float
        Probability that a gap has a cause outside the library.
    """

    kind: str
    p_value: float
    fit: Fit
    base: Fit
    rivals: dict[str, list[tuple[Rival, float]]]
    excess: list[Excess]
    unknown: float
    first: Stage | None = None
    classes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    weights: dict[str, dict[str, float]] = field(default_factory=dict)


def decide(
    evidence: AnyEvidence,
    library: Sequence[str],
    random_state: np.random.RandomState,
    progress: Callable[[str], None] | None = None,
) -> tuple[Verdict, Search]:
    """Search the library and decide."""
    search = Search(evidence, Fitter(evidence, getattr(evidence, "weights", None)), library, progress)
    base = search.base
    found = [t for many in search.templates.values() for t in many]
    test: Significance = library_test(evidence, base.fit, found, random_state)
    over = [excess(evidence, base.fit.z, part, s) for part, s in zip(evidence.parts, base.left, strict=True)]
    equations = max(len(over), 1)
    omnibus = min([min(1.0, equations * e.p_value) for e in over if e.scale > 1.0 + 2 * FORM_LEFT] or [1.0])
    p_value = min(1.0, 2.0 * min(test.p_value, omnibus))
    verdict = Verdict("none", p_value, base.fit, base.fit, {}, over, 0.0)
    if not found and p_value >= FALSE_ALARM:
        return verdict, search
    stage = search.stage(base.fit) if found else None
    verdict.first = stage
    best = stage.rivals[0] if stage and stage.rivals else None
    gain = search.gain(stage.before, best) if stage and best else 0.0
    if test.p_value < FALSE_ALARM and best and gain > LEAST_GAIN:
        _grow(search, verdict, best)
        verdict.unknown = float(1.0 / (1.0 + max(_left(search, verdict), 1e-3) ** -SHARP))
        names = list(verdict.fit.spec)
        verdict.kind = "unknown" if verdict.unknown > 0.5 else "several" if len(names) > 1 else "cause"
        for name in names:
            verdict.weights[name] = _weights(verdict.rivals[name])
            verdict.classes[name] = _class(verdict.weights[name], name)
        if verdict.kind == "cause" and len(verdict.classes[names[0]]) > 1:
            verdict.kind = "class"
    elif omnibus < FALSE_ALARM:
        verdict.kind, verdict.unknown = "unknown", 1.0 - omnibus
    return verdict, search


def _grow(search: Search, verdict: Verdict, best: Rival) -> None:
    """Add causes while each earns its place, then see whether any would now be replaced."""
    stage = search.stages[-1]
    fit = best.fit
    verdict.rivals[best.added] = [(r, search.gain(stage.before, r)) for r in stage.rivals]
    while len(fit.spec) < MAX_CAUSES:
        stage = search.stage(fit)
        for rival in stage.rivals:
            gain = search.gain(stage.before, rival)
            if gain <= LEAST_GAIN:
                break
            if _earns(search, stage.before, rival):
                fit = rival.fit
                verdict.rivals[rival.added] = [(r, search.gain(stage.before, r)) for r in stage.rivals]
                break
        else:
            break
        if gain <= LEAST_GAIN:
            break
    if len(fit.spec) > 1:
        fit = _exchanged(search, verdict, fit)
    verdict.fit = fit


def _earns(search: Search, before: Rival, after: Rival) -> bool:
    """Tell whether a further cause is more than an error of form of those before it."""
    known = [d for name, d in search.contributions(before.fit).items() if has_form(name)]
    audible = getattr(search.evidence, "audible", AUDIBLE)
    loud = np.array([[float(np.sqrt(np.mean(np.square(d[p])))) for p in search.evidence.parts] for d in known])
    for k, (b, a) in enumerate(zip(before.left, after.left, strict=True)):
        if b <= a or b <= 1.0:
            continue
        least = max(audible * loud[:, k].max(), CROSS * loud.max()) if len(known) else 0.0
        closed = (b**2 - a**2) / max(b**2 - min(1.0, a**2), 1e-9)
        voice = np.sqrt(max(b**2 - max(a, 1.0) ** 2, 0.0))
        if closed >= CLOSES and voice >= least:
            return True
    return False


def _exchanged(search: Search, verdict: Verdict, fit: Fit) -> Fit:
    """Try every earlier cause anew beside the others; what stood alone may have been a compromise."""
    for name in list(fit.spec)[:-1]:
        others = {k: v for k, v in fit.spec.items() if k != name}
        stage = search.stage(search.fitter.refine(others, steps=3))
        if not stage.rivals:
            continue
        best = stage.rivals[0]
        verdict.rivals.pop(name, None)
        verdict.rivals[best.added] = [(r, search.gain(stage.before, r)) for r in stage.rivals]
        fit = best.fit
    verdict.rivals = {name: verdict.rivals[name] for name in fit.spec if name in verdict.rivals}
    return fit


def _left(search: Search, verdict: Verdict) -> float:
    """Return how much the causes leave where they leave most of it, against what their forms excuse; 1 is the limit."""
    final = search.rival("", verdict.fit)
    worst, form = 0.0, getattr(search.evidence, "form_left", FORM_LEFT)
    excesses = [max(b**2 - 1.0, 0.0) for b in search.base.left]
    for before, after, total in zip(search.base.left, final.left, excesses, strict=True):
        worst = max(worst, float(after / (CLEAR + form * before)))
        if before > 1.25 and total > 0.25 * max(excesses):
            worst = max(worst, float((after**2 - 1.0) / total / SHARE_LEFT))
    return worst


def _weights(rivals: list[tuple[Rival, float]]) -> dict[str, float]:
    """Return what share of belief each alternative takes, its own form in doubt."""
    gains = np.array([gain for _, gain in rivals])
    width = DOUBT + DOUBT_SHARE * max(float(gains.max()), 0.0)
    w = np.exp((gains - gains.max()) / width)
    return {r.added: float(v) for (r, _), v in zip(rivals, w / w.sum(), strict=True)}


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
        if total >= 0.95:
            break
    return tuple(chosen)

"""From fits to an answer: is there a gap, is an effect its cause, a class, several, or none that is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...effects import all_effects
from ..inference.gauss_newton import Fit, Fitter
from ..inference.growth import grow
from ..inference.search import MAX_CAUSES, Rival, Search, Stage, has_form
from ..inference.significance import Excess, Significance, excess, library_test, outliers
from ..residuals.protocol import ResidualSource
from .closure import shapley

FALSE_ALARM = 0.01
"""Probability at which the evidence of an effect or of an excess counts as a gap."""
HEARD = 0.08
"""Share by which a residual must be above its noise to be a gap by itself, since noise is known to a few per cent."""
CLEAR = 1.5
"""Scale of what is left, in noise, up to which a cause may leave something unexplained; for its form comes on top."""
SHARE_LEFT = 0.4
"""Share of an equation's excess that may be left."""
SHARP = 8.0
"""How sharply doubt rises at those limits."""
WHISPER, PATCHED = 0.05, 0.7
"""Share below which a further cause is a scrap, and the probability that the cause of a patched account is beyond the
library."""
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
    first : Stage or None
        The first round of the search.
    classes : dict of str to tuple of str
        For each cause the names that cannot be told apart from it, itself first.
    weights : dict of str to dict of str to float
        For each cause the share of belief of each alternative.
    part_of : dict of str to float
        For each cause its share of what all explain together.
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
    part_of: dict[str, float] = field(default_factory=dict)


def decide(
    evidence: ResidualSource,
    library: Sequence[str],
    random_state: np.random.RandomState,
    progress: Callable[[str], None] | None = None,
) -> tuple[Verdict, Search]:
    """Search the library and decide."""
    search = Search(evidence, Fitter(evidence), library, progress)
    base = search.base
    found = [t for many in search.templates.values() for t in many]
    test: Significance = library_test(evidence, base.fit, found, random_state)
    over = [excess(evidence, base.fit.z, part, s) for part, s in zip(evidence.parts, base.left, strict=True)]
    equations = max(len(over), 1)
    omnibus = min([min(1.0, equations * e.p_value) for e in over if e.scale > 1.0 + HEARD] or [1.0])
    omnibus = min(omnibus, outliers(evidence, base.fit.z))
    stage = search.stage(base.fit) if found else None
    best = stage.rivals[0] if stage and stage.rivals else None
    gain = search.gain(stage.before, best) if stage and best else 0.0
    chance = min(test.p_value, float(np.exp(-gain - 1.0))) if gain > evidence.decisive else test.p_value
    p_value = min(1.0, 2.0 * min(chance, omnibus))
    verdict = Verdict("none", p_value, base.fit, base.fit, {}, over, 0.0, stage)
    if chance < FALSE_ALARM and best and gain > evidence.least_gain:
        verdict.fit, verdict.rivals = grow(search, best)
        verdict.unknown = float(1.0 / (1.0 + max(_left(search, verdict), 1e-3) ** -SHARP))
        names = list(verdict.fit.spec)
        verdict.part_of = shapley(search.fitter, base.fit, verdict.fit)
        if evidence.exact and _patched(verdict.part_of):
            verdict.unknown = max(verdict.unknown, PATCHED)
        verdict.kind = "unknown" if verdict.unknown > 0.5 else "several" if len(names) > 1 else "cause"
        for name in names:
            verdict.weights[name] = _weights(verdict.rivals[name])
            verdict.classes[name] = _class(verdict.weights[name], name)
        if verdict.kind == "cause" and len(verdict.classes[names[0]]) > 1:
            verdict.kind = "class"
    elif omnibus < FALSE_ALARM:
        verdict.kind, verdict.unknown = "unknown", 1.0 - omnibus
    return verdict, search


def _left(search: Search, verdict: Verdict) -> float:
    """Return how much the causes leave where they leave most of it, against what their forms excuse; 1 is the limit.

    Where a cause of a rough form acts, windows count as they are: an error of form is slow, and would weigh more among
    residuals of independent noise.
    """
    evidence, names = search.evidence, set(verdict.fit.spec)
    # Without any cause, tolerances may hide in one equation what they cause in another: each cause shows beside others.
    accounts = [search.base, *(s.before for s in search.stages if set(s.before.fit.spec) < names)]
    rivals = [search.rival("", verdict.fit), *accounts]
    white, raw = [r.left for r in rivals], [search.scales(evidence.raw(r.z)) for r in rivals]
    touched = evidence.touched([name for name in names if has_form(name)])
    rough = np.array([e in touched for e in evidence.equations])
    left = np.where(rough, raw, white)
    final, loudest = left[0], left[1:].max(axis=0)
    worst, excesses = 0.0, np.maximum(np.square(loudest) - 1.0, 0.0)
    limits = CLEAR + evidence.excused(loudest, rough)
    for before, after, total, limit in zip(loudest, final, excesses, limits, strict=True):
        worst = max(worst, float(after / limit))
        if before > 1.25 and total > 0.25 * max(excesses):
            worst = max(worst, float((after**2 - 1.0) / total / SHARE_LEFT))
    return worst


def _patched(part_of: dict[str, float]) -> bool:
    """Tell whether an account is patched up: then a cause beyond the library is likelier.

    That is three causes of weight, or causes whose forms are known, such as gains, that need another for a scrap. A
    second fault of one sensor is no such scrap: a gain that is a little bent reads like a gain with an offset.
    """
    weighty = [name for name, share in part_of.items() if share >= WHISPER]
    sensors = {all_effects()[name].channel for name in weighty} - {""}
    scraps = [name for name in part_of if name not in weighty and all_effects()[name].channel not in sensors]
    return len(weighty) >= MAX_CAUSES or (bool(scraps) and not any(has_form(name) for name in weighty))


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

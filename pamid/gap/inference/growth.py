"""From one cause to several: a further one while it earns its place, then exchanges, then the shortest account."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from ...effects import all_effects
from .gauss_newton import Fit
from .search import MAX_CAUSES, Rival, Search, Stage, cross, has_form

LEAST_GAIN = 10.0
"""Gain in log-likelihood that a further effect must bring at least."""
CLOSES = 0.4
"""Share of what is left in an equation that a further cause must close."""
REMEMBERED = 2.5
"""How much louder it must be beside an effect with a memory, whose form errs more."""
RARE = 0.03
"""Share of windows below which an effect speaks in so few that the scale of all of them would not hear it …"""
SHOUTS = 4.0
"""… and how loud, in noise, what is left there must be to be heard alone."""
OTHERS, OTHER_SHARE = 2, 0.3
"""Other beginnings that are followed to their end where several causes are found, and the share of the best single gain
that they must bring."""
CLEAN = 1.06
"""Scale of what is left, in noise, up to which two causes need no other beginning."""
BETTER, BETTER_SHARE = 4.0, 0.004
"""How much more an account from another beginning must explain: nats, and share of the gain."""
ALIKE, ALIKE_SHARE = 30.0, 0.03
"""How much less a shorter account may explain at first sight: nats, and share of the gain."""

Alternatives = dict[str, list[tuple[Rival, float]]]
"""For each cause its alternatives with their gains, itself among them, the best first."""


def grow(search: Search, best: Rival) -> tuple[Fit, Alternatives]:
    """Return what explains a log, beginning with its best single effect, and the alternatives to each cause.

    Parameters
    ----------
    search : Search
        The search, its first stage done.
    best : Rival
        The best of that stage.
    """
    first = search.stages[-1]
    fit, rivals = _from(search, first, best)
    if len(fit.spec) > 1 and not _settled(search, fit):
        # The effect that explains most alone may stand between two true ones.
        seeds = [r for r, gain in _gains(search, first)[1:] if gain > OTHER_SHARE * search.gain(first.before, best)]
        for seed in [r for r in seeds if r.added not in fit.spec][:OTHERS]:
            other, alternatives = _from(search, first, seed)
            if _preferred(other, fit, search.base.fit.loglik):
                fit, rivals = other, alternatives
    if len(fit.spec) > 1:
        fit = _shortened(search, rivals, fit)
    return fit, {name: rivals[name] for name in fit.spec if name in rivals}


def _settled(search: Search, fit: Fit) -> bool:
    """Tell whether two causes leave nothing but noise, which a wrong beginning rarely comes to."""
    return len(fit.spec) == 2 and bool(np.all(search.rival("", fit).left < CLEAN))


def _from(search: Search, first: Stage, seed: Rival) -> tuple[Fit, Alternatives]:
    """Return what a beginning grows to."""
    rivals: Alternatives = {seed.added: _gains(search, first)}
    fit = _grown(search, seed.fit, rivals)
    return (_exchanged(search, rivals, fit) if len(fit.spec) > 1 else fit), rivals


def _preferred(other: Fit, fit: Fit, base: float) -> bool:
    """Tell whether an account with fewer causes explains about as much, or one with no more causes clearly more."""
    gain = fit.loglik - base
    if len(other.spec) < len(fit.spec):
        return other.loglik > fit.loglik - ALIKE - ALIKE_SHARE * gain
    margin = LEAST_GAIN * (len(other.spec) - len(fit.spec))
    return other.loglik > fit.loglik + margin + BETTER + BETTER_SHARE * gain


def _gains(search: Search, stage: Stage) -> list[tuple[Rival, float]]:
    return [(r, search.gain(stage.before, r)) for r in stage.rivals]


def _grown(search: Search, fit: Fit, rivals: Alternatives) -> Fit:
    """Add causes as long as one of them earns its place."""
    while len(fit.spec) < MAX_CAUSES:
        stage = search.stage(fit)
        found = _gains(search, stage)
        earned = next((r for r, gain in found if gain > LEAST_GAIN and earns(search, stage.before, r)), None)
        if earned is None:
            break
        fit, rivals[earned.added] = earned.fit, found
    return fit


def earns(search: Search, before: Rival, after: Rival) -> bool:
    """Tell whether a further cause is more than an error of form of those before it.

    It must close a good share of what is left in an equation, and be audible there beside the causes before it. An
    effect that speaks in few windows, such as a saturation, is judged on those.

    Parameters
    ----------
    search : Search
        The search.
    before, after : Rival
        The explanation without and with it.
    """
    # Alone, the others may have been a compromise that is louder than they are: beside it they are what they are.
    whole = search.contributions(after.fit)
    others = {name: d for name, d in whole.items() if name != after.added}
    evidence = search.evidence
    for equation, part, b, a in zip(evidence.equations, evidence.parts, before.left, after.left, strict=True):
        heard: list[tuple[np.ndarray | None, float, float, float]] = [(None, 1.0, b, a)]
        if (few := _few(whole[after.added][part])) is not None:
            heard.append((few, SHOUTS, _level(before.z[part], few), _level(after.z[part], few)))
        for weight, least, left, still in heard:
            if left > max(still, least) and _closes(left, still, _whisper(search, others, equation, part, weight)):
                return True
    return False


def _closes(left: float, still: float, whisper: float) -> bool:
    """Tell whether a cause closes enough of what is left, and is no whisper."""
    closed = (left**2 - still**2) / max(left**2 - min(1.0, still**2), 1e-9)
    voice = np.sqrt(max(left**2 - max(still, 1.0) ** 2, 0.0))
    return bool(closed >= CLOSES and voice >= whisper)


def _whisper(
    search: Search, others: Mapping[str, np.ndarray], equation: str, part: slice, weight: np.ndarray | None
) -> float:
    """Return how loud weighted windows of an equation may be for an error of form of the causes that are there."""
    library, least = all_effects(), 0.0
    for name, d in others.items():
        if not has_form(name):
            continue
        if equation in search.evidence.touched([name]):
            # Where it does not act, what tolerances make of it is known, and no error of its form.
            remembers = library[name].n_states > 0 and library[name].family != "friction"
            share = search.evidence.audible * (REMEMBERED if remembers else 1.0)
            least = max(least, share * _level(d[part], weight))
        if cross(name):
            least = max(least, cross(name) * search.loudness(d))
    return least


def _level(z: np.ndarray, weight: np.ndarray | None = None) -> float:
    """Return the root mean square over windows, all alike without weights."""
    return float(np.sqrt(np.average(np.square(z), weights=weight))) if len(z) else 0.0


def _few(d: np.ndarray) -> np.ndarray | None:
    """Return the weights of the windows in which an effect speaks if they are few, else None."""
    power = np.square(d)
    total = float(power.sum())
    if total <= 0.0 or total**2 > RARE * len(d) * float(np.square(power).sum()):
        return None
    return np.abs(d)


def _exchanged(search: Search, rivals: Alternatives, fit: Fit) -> Fit:
    """Try every earlier cause anew beside the others: alone it may have been a compromise, and now be none at all."""
    for name in list(fit.spec)[:-1]:
        others = {k: v for k, v in fit.spec.items() if k != name}
        stage = search.stage(search.fitter.refine(others, steps=3, near=fit.x))
        found = [f for f in _gains(search, stage) if f[0].added != name]
        stands = search.rival(name, fit, search.softness(stage.before.fit))
        found = sorted([*found, (stands, search.gain(stage.before, stands))], key=lambda f: -f[1])
        best, gain = found[0]
        rivals.pop(name, None)
        if gain > LEAST_GAIN and earns(search, stage.before, best):
            fit, rivals[best.added] = best.fit, found
        else:
            fit = stage.before.fit
    return fit


def _shortened(search: Search, rivals: Alternatives, fit: Fit) -> Fit:
    """Look for one effect in the place of two: a close relative may have been taken first, and its error for a cause.

    The shorter account must explain about as much, and nothing further may earn a place beside it.
    """
    whole = search.base.fit.loglik
    for pair in combinations(list(fit.spec), 2):
        others = {k: v for k, v in fit.spec.items() if k not in pair}
        stage = search.stage(search.fitter.refine(others, steps=3, near=fit.x)) if others else search.stages[0]
        worst = fit.loglik - ALIKE - ALIKE_SHARE * (fit.loglik - whole)
        for rival, gain in _gains(search, stage):
            if rival.added in pair or gain <= LEAST_GAIN or rival.fit.loglik < worst:
                continue
            if len(_grown(search, rival.fit, {}).spec) == len(rival.fit.spec):
                for name in pair:
                    rivals.pop(name, None)
                rivals[rival.added] = _gains(search, stage)
                return rival.fit if len(rival.fit.spec) < 2 else _shortened(search, rivals, rival.fit)
    return fit

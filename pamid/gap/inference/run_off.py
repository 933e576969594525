"""Sets of effects that a log's equations hardly tell apart are run: the motion that follows from each decides.

While dry friction holds a joint, any force within it balances: its equation says no more than that of a play in the
command, which leaves the drive just that force. What follows differs, since a joint that coasts on has not turned with
its command. In an equation that is a few windows far out, which a robust likelihood forgives; in the simulated motion
it goes on for as long as the motion remembers. The effects are as the equations had them, so that runs test them; what
fares worse is refitted to the runs before it is ruled out, since a small error of a size may be all that it shows.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..residuals.protocol import Spec
from ..settings import CLOSE, CLOSE_SHARE, DECIDED, KEPT
from .competition import ROUNDS, Competition
from .hypotheses import Hypothesis, Outcome
from .sensitivity import adds
from .so_far import in_words

Run = Callable[[Spec, bool, float], "float | None"]
"""Returns the log-likelihood of the log in runs of the simulator with effects, refitted if asked, unless that promises
less than a bound; None where it cannot be run."""


def by_running(competition: Competition, outcome: Outcome, run: Run) -> Outcome:
    """Return the outcome without effects whose runs miss the log by far more than those of another in their place."""
    known: dict[tuple[frozenset[str], bool], float | None] = {}

    def ran(h: Hypothesis, refit: bool = False, behind: float = -np.inf) -> float | None:
        if (h.names, refit) not in known:
            competition.say("run " + ", ".join(map(in_words, h.fit.spec)))
            known[h.names, refit] = run(h.fit.spec, refit, behind)
        return known[h.names, refit]

    for _ in range(ROUNDS):
        worse = set[tuple[str, str]]()
        for name, others in _near(competition, outcome).items():
            found = {other: score for other, h in others.items() if (score := ran(h)) is not None}
            best = max(found, key=lambda other: found[other], default=name)
            least = found[best] - DECIDED
            behind = [other for other, score in found.items() if score < least]
            worse |= {(k, best) for k in behind if (ran(others[k], True, least) or found[k]) < least}
        if not worse - competition.worse:
            break
        outcome = competition.without(worse, outcome)
    return replace(outcome, unseen=lambda hides: _unseen(competition, outcome, ran, hides))


def _unseen(
    competition: Competition, outcome: Outcome, ran: Callable[..., "float | None"], hides: Callable[[Spec], bool]
) -> bool:  # fmt: skip
    """Return whether what holds a motion, and noise hides, simulates it better than a cause that equations prefer.

    A cause that leaves more than noise may leave what happens near rest, where rates are mostly noise. What leaves
    more than twice as much is no rival.
    """
    best, effects = outcome.best, competition.evidence.effects
    if competition.enough(best) or any(effects[name].holds for name in best.names):
        return False
    for name in best.names:
        for h in competition.likeliest(best, name, lambda k: effects[k].holds):
            sharp = {k: effects[k](**values).sharp().values for k, values in h.fit.spec.items()}
            if np.any(h.left > 2.0 * best.left) or not hides(sharp):
                continue
            if (here := ran(best)) is None or (there := ran(h, True, here + DECIDED)) is None:
                continue
            if there > here + DECIDED and there > (ran(best, True) or here) + DECIDED:
                return True
    return False


def _near(competition: Competition, outcome: Outcome) -> dict[str, dict[str, Hypothesis]]:
    """Return the causes that others may replace, as far as equations tell, with the sets by their replacement."""
    best, effects, twins = outcome.best, competition.evidence.effects, competition.evidence.twins
    close = [
        (h, name)
        for name, some in outcome.alternatives.items()
        for h in some
        if h is not best and h.score > best.score - DECIDED and twins.get(name) not in h.names
    ]
    close = sorted(close, key=lambda c: -c[0].score)[:KEPT]
    for name in best.names:
        if "command" in effects[name].hooks():
            holding = competition.likeliest(best, name, lambda k: effects[k].path_dependent and adds(effects[k]))
            reach = CLOSE + CLOSE_SHARE * (best.score - competition.base.score)
            close += [(h, name) for h in holding if h.score > best.score - reach]
    found: dict[str, dict[str, Hypothesis]] = {}
    for h, name in close:
        other = next(iter(h.names - best.names))
        if len({"command" in effects[k].hooks() for k in (name, other)}) > 1:
            found.setdefault(name, {name: best})[other] = h
    return found

"""Sets of effects that a log's equations hardly tell apart are run: the motion that follows from each decides.

While dry friction holds a joint, any force within it balances: its equation says no more than that of a play in the
command, which leaves the drive just that force. What follows differs, since a joint that coasts on has not turned with
its command. In an equation that is a few windows far out, which a robust likelihood forgives; in the simulated motion
it goes on for as long as the motion remembers. The effects are as the equations had them, so that runs test them.
"""

from __future__ import annotations

from collections.abc import Callable

from ..residuals.protocol import Spec
from ..settings import DECIDED, KEPT
from .competition import ROUNDS, Competition
from .hypotheses import Hypothesis, Outcome
from .so_far import in_words

Run = Callable[[Spec], "float | None"]
"""Returns the log-likelihood of the log in runs of the simulator with effects; None where it cannot be run."""


def by_running(competition: Competition, outcome: Outcome, run: Run) -> Outcome:
    """Return the outcome without effects whose runs miss the log by far more than those of another in their place."""
    known: dict[frozenset[str], float | None] = {}

    def ran(h: Hypothesis) -> float | None:
        if h.names not in known:
            competition.say("run " + ", ".join(map(in_words, h.fit.spec)))
            known[h.names] = run(h.fit.spec)
        return known[h.names]

    for _ in range(ROUNDS):
        worse = set[tuple[str, str]]()
        for name, others in _near(competition, outcome).items():
            found = {other: score for other, h in others.items() if (score := ran(h)) is not None}
            best = max(found, key=lambda other: found[other], default=name)
            worse |= {(other, best) for other, score in found.items() if score < found[best] - DECIDED}
        if not worse - competition.worse or competition.interrupted:
            break
        outcome = competition.without(worse, outcome)
    return outcome


def _near(competition: Competition, outcome: Outcome) -> dict[str, dict[str, Hypothesis]]:
    """Return the causes that others may replace, as far as equations tell, with the sets by what is in their place."""
    best, twins = outcome.best, competition.evidence.twins
    close = [
        (h, name)
        for name, some in outcome.alternatives.items()
        for h in some
        if h is not best and h.score > best.score - DECIDED and twins.get(name) not in h.names
    ]
    found: dict[str, dict[str, Hypothesis]] = {}
    for h, name in sorted(close, key=lambda c: -c[0].score)[:KEPT]:
        found.setdefault(name, {name: best})[next(iter(h.names - best.names))] = h
    return found

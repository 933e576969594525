"""Steps of an integrator instead of causes: where some were found, fewer and such steps may explain as much."""

from collections.abc import Callable

import numpy as np

from ..residuals.protocol import ResidualSource
from ..settings import LEAST_GAIN
from .competition import Competition
from .gauss_newton import Fitter
from .hypotheses import Hypothesis, Outcome
from .sensitivity import Template


def with_steps(
    competition: Competition, outcome: Outcome, search: Callable[[Competition], Outcome]
) -> tuple[Competition, Outcome] | None:
    """Return the search with such steps as a nuisance if it then needs fewer causes, else None."""
    evidence = competition.evidence.stepped() if outcome.best.names else None
    if evidence is None or not _promise(competition, evidence, outcome):
        return None
    known: dict[str, list[Template]] = {name: [] for name in competition.library}
    for template in competition.templates:
        known[template.effect].append(template)
    again = Competition(evidence, competition.library, competition.say, known)
    found = search(again)
    fewer = len(found.best.names) < len(outcome.best.names)
    better = again.comparable(found.best) > competition.comparable(outcome.best) + LEAST_GAIN
    return (again, found) if fewer and better else None


def _promise(competition: Competition, stepped: ResidualSource, outcome: Outcome) -> bool:
    """Return whether steps and a part of the causes that were found promise to explain as much, to first order."""
    free, least = Fitter(stepped), competition.comparable(outcome.best)

    def promised(h: Hypothesis) -> float:
        x = np.append(h.fit.x, np.zeros(free.n - len(h.fit.x)))
        gain = free.promise(h.fit.spec, x) - competition.fitter.promise(h.fit.spec, h.fit.x)
        return competition.comparable(h) + gain

    parts = (h for h in outcome.refitted if h.names < outcome.best.names)
    return any(promised(h) > least for h in (outcome.base, *parts))

"""Steps of an integrator beside causes: fewer causes may then explain as much, or the same ones the whole log."""

from collections.abc import Callable

import numpy as np

from ..residuals.protocol import ResidualSource
from ..settings import LEAST_GAIN
from .competition import Competition
from .gauss_newton import Fitter
from .hypotheses import Hypothesis, Outcome
from .sensitivity import Template
from .student_t import scale


def with_steps(
    competition: Competition, outcome: Outcome, search: Callable[[Competition], Outcome]
) -> tuple[Competition, Outcome] | None:
    """Return the search with such steps as a nuisance if it needs fewer causes or leaves no gap any more, else None."""
    evidence = competition.evidence.stepped() if outcome.best.names else None
    if evidence is None or not _promise(competition, evidence, outcome):
        return None
    known: dict[str, list[Template]] = {name: [] for name in competition.library}
    for template in competition.templates:
        known[template.effect].append(template)
    again = Competition(evidence, competition.library, competition.say, known)
    found = search(again)
    competition.interrupted = again.interrupted  # whoever interrupts this search waits for nothing after it, either
    fewer = len(outcome.best.names) - len(found.best.names)
    whole = fewer == 0 and again.enough(found.best) and not competition.enough(outcome.best)
    better = again.comparable(found.best) > competition.comparable(outcome.best) + LEAST_GAIN
    return (again, found) if better and (fewer > 0 or whole) else None


def _promise(competition: Competition, stepped: ResidualSource, outcome: Outcome) -> bool:
    """Return whether steps promise to explain as much with fewer causes, or with all of them where a gap is left."""
    free, least, best = Fitter(stepped), competition.comparable(outcome.best), outcome.best

    def promised(h: Hypothesis) -> tuple[float, np.ndarray]:
        x = np.append(h.fit.x, np.zeros(free.n - len(h.fit.x)))
        there, here = free.promise(h.fit.spec, x), competition.fitter.promise(h.fit.spec, h.fit.x)
        closed = [scale(there.z[p], 0.0) / max(scale(here.z[p], 0.0), 1e-300) for p in stepped.parts]
        return competition.comparable(h) + there.loglik - here.loglik, h.left * closed

    parts = (h for h in outcome.refitted if h.names < best.names)
    if any(promised(h)[0] > least for h in (outcome.base, *parts)):
        return True
    if competition.enough(best):
        return False
    # Half of what is left to first order may be all of it exactly.
    here, there = (np.maximum(left - competition.least, 0.0) for left in (best.left, promised(best)[1]))
    return bool(np.all(there <= 0.5 * here))

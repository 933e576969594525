"""The diagnosis of any simulator with ports: which effect, at which port, and the corrected simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ..simulators.base import Simulator
from .design.experiment import next_for_equation
from .diagnosis.decide import Verdict
from .diagnosis.result import Diagnosis
from .engine import explain, rows_searched
from .inference.floor import Learned
from .inference.gauss_newton import Fitter
from .inference.hypotheses import Outcome
from .inference.so_far import INTERRUPTED, twice, unless_stopped, where_so_far
from .inference.student_t import scale
from .readings import settled
from .rerun import tried
from .residuals.choice import beside_inputs, noise_hides
from .residuals.direct import DirectEvidence
from .residuals.part import remember_as, to_search
from .residuals.ports import PortEvidence
from .residuals.protocol import Spec
from .residuals.shooting import ShootingEvidence
from .residuals.single import SignalEvidence
from .residuals.untested import untested
from .settings import EXCESS, LEAST_GAIN
from .simulated import added, evidence_of, learn, otherwise, outward, runner

if TYPE_CHECKING:
    from .several.stacked import StackedEvidence

DROWNED = (
    "The readings were predicted rather than put into the equations, where undoing a sensor's fault would amplify the "
    "noise and hide the rest."
)
UNSEEN = "The readings were predicted rather than put into the equations, where their noise hides how a force acts."
PULLED = (
    "The readings were predicted rather than put into the equations, where noise in the readings would change a "
    "parameter together with a cause."
)
SLOW = (
    "Predicted over longer stretches, the corrected simulator leaves more than noise explains: something slow is "
    "missing, too, and no set of causes was found that contains both."
)
BURIED = "The readings were predicted rather than put into the equations, in each of which noise exceeds the gap."


class Judged(NamedTuple):
    """A diagnosis, and what it is of."""

    found: Diagnosis
    evidence: PortEvidence
    learned: Sequence[Learned]
    """The residuals of a learner on it."""


class OtherNoiseError(Exception):
    """The noise has turned out to be another, and causes have to be searched again, beginning with some."""

    def __init__(self, begin: Spec | None = None) -> None:
        super().__init__("the noise is another")
        self.begin = begin


class UnjudgedError(Exception):
    """The equations cannot judge what predictions can: why, what they found, and predictions where made."""

    def __init__(self, why: str, found: Spec | None = None, predicted: ShootingEvidence | None = None) -> None:
        super().__init__(why)
        self.found, self.predicted = found or {}, predicted


def diagnose_at_ports(
    log: pd.DataFrame,
    simulator: Simulator,
    effects: str | Sequence[str],
    seed: int,
    say: Callable[[str], None],
    change: Callable[[int], float] | None = None,
) -> Diagnosis:
    """Diagnose one log of a simulator with ports; `change` as in `explain`."""
    evidence = evidence_of(log, simulator, refit=True, say=say)
    judged = diagnose_evidence(evidence, effects, seed, say, change)
    found = judged.found

    def cut() -> Judged:
        return judged._replace(found=replace(found, notes=[*found.notes, INTERRUPTED]))

    def with_noise_of_inputs() -> Judged:
        if found.verdict in ("none", "untested"):
            return judged
        left = Fitter(evidence).refine(added(evidence, found)) if found.added else evidence.without_causes()
        if not evidence.hear_inputs(left):
            return judged
        say("again, allowing for noise in the inputs")
        return diagnose_evidence(evidence, effects, seed, say, change)

    def with_inputs_otherwise() -> Judged:
        other = otherwise(evidence, found, log)
        if other is None:
            return judged
        say(f"again, with inputs {'interpolated between rows' if other.lines else 'held over each step'}")
        return diagnose_evidence(other, effects, seed, say, change, added(evidence, found))

    def over_longer_stretches() -> Judged:
        longer = judged.evidence.longer if isinstance(judged.evidence, ShootingEvidence) else None
        if longer is None or not found.added:
            return judged
        spec = added(judged.evidence, found)
        longer.hear_inputs(Fitter(longer).refine(spec))
        if not longer.beyond_inputs:
            return judged
        say("again, over longer stretches, in which more is left than noise of the inputs explains")
        there = diagnose_evidence(longer, effects, seed, say, change, spec)
        if spec.keys() <= added(longer, there.found).keys():
            return there
        return judged._replace(found=replace(found, notes=[*found.notes, SLOW]))

    for again in (with_noise_of_inputs, with_inputs_otherwise, over_longer_stretches):
        if not found.interrupted:  # who interrupted the search waits for no other
            judged = unless_stopped(again, cut)
            found = judged.found
    return tried(found, log, judged.evidence)


def diagnose_evidence(
    evidence: PortEvidence,
    effects: str | Sequence[str],
    seed: int,
    say: Callable[[str], None] = lambda _: None,
    change: Callable[[int], float] | None = None,
    begin: Spec | None = None,
) -> Judged:
    """Return the diagnosis of a log's evidence; `begin` as in `explain`."""
    left_out = untested(evidence, effects)
    asked = [name for name in evidence.library(effects) if evidence.has(name)]
    log, simulator = evidence.log, evidence.simulator
    # Thousands of small products: threads would only wait for one another.
    with threadpool_limits(1):
        searched = to_search(evidence) if isinstance(evidence, DirectEvidence) else evidence
        asked = settled(evidence, log, simulator, asked, say)
        if searched is not evidence:
            settled(searched, searched.log, simulator, asked, say)
        say("estimate what could be explained")
        say(where_so_far(searched.equations, np.array([scale(searched.z0[p], 0.0) for p in searched.parts])))
        known = learn(searched, asked, say)
        library = [name for name in asked if known.templates.get(name)]
        notes = list(dict.fromkeys([*evidence.heard(known.share), *evidence.notes, *left_out]))
        if isinstance(searched, DirectEvidence) and isinstance(evidence, DirectEvidence) and searched is not evidence:
            remember_as(evidence, searched)
            notes.append(rows_searched(searched.log.n, log.n))

        def heed(outcome: Outcome, verdict: Verdict) -> None:
            doubted, best = verdict.reserved or not verdict.named, outcome.best
            beyond = verdict.kind != "none" and np.any(best.left > 1.0 + EXCESS)
            # What a cause leaves of predictions lasts, as noise might.
            asked = searched is evidence and not (verdict.named and evidence.simulates)
            if doubted and beyond and asked and evidence.hear_memory(best.fit):
                raise OtherNoiseError
            if evidence.hears_memory and verdict.named and np.any(np.sqrt(2.0) * best.left < 1.0):
                evidence.hear_less()  # a cause closes what was taken for noise
                raise OtherNoiseError(best.fit.spec)
            if not isinstance(searched, DirectEvidence) or simulator.form != "ode" or simulator.one_by_one:
                return
            if searched.made_in_samples:  # predictions by exact integration would drift away from it
                return
            if any(map(searched.drowns, in_question(outcome))):
                raise UnjudgedError(DROWNED, best.fit.spec)
            if verdict.named and max(searched.pulled_under(best.fit.spec, best.fit.x)) > LEAST_GAIN:
                raise UnjudgedError(PULLED, best.fit.spec)
            if outcome.unseen(searched.hides) or (doubted and any(map(searched.hides, about_as_good(outcome)))):
                raise UnjudgedError(UNSEEN, best.fit.spec)
            promising = best.score - outcome.base.score > searched.least_gain
            if promising and not verdict.named and np.all(outcome.base.left < np.sqrt(2.0)):
                raise UnjudgedError(BURIED, best.fit.spec)

        try:
            found = explain(
                evidence,
                library,
                np.random.RandomState(seed),
                notes,
                say,
                searched,
                known.templates,
                known.interrupted,
                runner(searched),
                change,
                heed,
                begin,
            )
            nothing = not found.interrupted and found.verdict == "none"
            if nothing and (predicted := shown_by_predictions(evidence)) is not None:
                raise UnjudgedError(BURIED, predicted=predicted)
        except OtherNoiseError as other:
            say("again, with noise that lasts" if other.begin is None else "again, without noise that lasts")
            return diagnose_evidence(evidence, effects, seed, say, change, other.begin or begin)
        except UnjudgedError as why:
            say("again, by predictions, in which noise hides less than in the equations")
            predicted = why.predicted or by_predictions(evidence)
            predicted.notes.append(str(why))
            begin = {
                name: predicted.placements[name].inward(searched.placements[name].outward(values))
                for name, values in why.found.items()
            }
            return diagnose_evidence(predicted, effects, seed, say, change, begin)
    return Judged(twice(lambda _: told(found, evidence)), evidence, known.learned)


def by_predictions(evidence: PortEvidence) -> ShootingEvidence:
    """Return what is left where the simulator predicts the log over stretches."""
    return beside_inputs(ShootingEvidence(evidence.log, evidence.given, refit=evidence.refit, lines=evidence.lines))


def shown_by_predictions(evidence: PortEvidence) -> ShootingEvidence | None:
    """Return predictions that leave as much as the noise or more where equations leave nothing; None without such.

    Accelerations from positions are mostly noise; in predictions, slow errors of them add up.
    """
    if not isinstance(evidence, DirectEvidence) or evidence.simulator.form != "ode" or evidence.simulator.one_by_one:
        return None
    if evidence.made_in_samples or not noise_hides(evidence):
        return None
    found = by_predictions(evidence)
    return found if np.any(found.without_causes().scales > np.sqrt(2.0)) else None


def in_question(outcome: Outcome) -> list[Spec]:
    """Return the best set, and those no larger that close the gap it leaves, but were too dear in noise."""
    best = outcome.best
    few = [h for h in outcome.refitted if h is not best and len(h.fit.spec) <= len(best.fit.spec)]
    # To leave less than the noise is no gain.
    beyond = {id(h): float(np.prod(np.maximum(h.left, 1.0))) for h in (best, *few)}
    closed = [h.fit.spec for h in few if np.all(h.left <= 1.0 + EXCESS) and beyond[id(h)] < beyond[id(best)]]
    return [best.fit.spec, *closed]


def about_as_good(outcome: Outcome) -> list[Spec]:
    """Return the sets that leave less than twice what the best one leaves, if that is as much as the noise or more."""
    best = outcome.best.left
    return [h.fit.spec for h in outcome.refitted if np.any(best > np.sqrt(2.0)) and np.all(h.left <= 2.0 * best)]


def told(found: Diagnosis, evidence: PortEvidence, source: StackedEvidence | None = None) -> Diagnosis:
    """Return a diagnosis in the units of the ports, of one equation with the run to record next."""
    run = next_for_equation(found.rivals, evidence) if isinstance(evidence, SignalEvidence) else None
    return replace(outward(found, evidence, source), next_run=run)

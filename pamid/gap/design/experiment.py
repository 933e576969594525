"""The run that a diagnosis itself proposes: for a bench from a short list, for an equation within the log's range."""

from collections.abc import Callable, Sequence

import numpy as np

from ...bench.references import PERIOD
from ...errors import ExcitationError
from ..diagnosis.decide import Verdict
from ..diagnosis.findings import NextExperiment
from ..diagnosis.rivals import Rival
from ..residuals.bench import Evidence
from ..residuals.protocol import Spec
from ..residuals.single import SignalEvidence
from ..settings import DECIDED
from .bench import Bench
from .family import SAMPLES, STANDARD, Limits
from .known import fit_of, known_of
from .plan import TELLS
from .port_family import PortLimits
from .ports import EquationRig
from .score import Discrimination
from .search import plan_as_is


def next_experiment(
    evidence: Evidence, verdict: Verdict, here: Callable[[Spec], Spec] = dict
) -> tuple[NextExperiment | None, tuple[str, ...]]:
    """Return the next run to record on a bench and the two explanations that it separates, or None."""
    two = [here(spec) for spec in _closest(verdict)]
    names = tuple(next((n for n in a if n not in b), "") for a, b in zip(two, reversed(two), strict=True))
    if len(two) < 2 or not all(names):
        return None, ()
    rig, rng = Bench(evidence.params, [evidence], Limits()), np.random.default_rng(0)
    known = [known_of(rig.logs, fit_of(Rival(spec, {}, 0.0, 0.5), evidence), 0.5, rng) for spec in two]
    try:
        table, there = rig.recorded(STANDARD, known[0].fit)
    except ExcitationError:
        return None, ()
    told = Discrimination(rig.evidence(table), known, forms=False)
    nats = [float(told.between([k])[0, 1]) for k in range(len(there))]
    best = int(np.argmax(nats))
    if not nats[best] >= TELLS:
        return None, names
    reason = (
        f"{names[0]} and {names[1]}, each refitted, would differ in log-likelihood by about {nats[best]:.0f} "
        f"over a run of {SAMPLES * PERIOD:g} s"
    )
    return NextExperiment(STANDARD[there[best]].as_dict(), names, nats[best], reason), names


def _closest(verdict: Verdict) -> list[Spec]:
    """Return the two explanations closest to each other; none where one is clearly ahead."""
    best, outcome = verdict.outcome.best, verdict.outcome
    if verdict.named:
        others = [[h for h in ranked if n not in h.names] for n, ranked in outcome.alternatives.items()]
        pairs = [(best, ranked[0]) for ranked in others if ranked]
    else:
        alone = [h for h in outcome.refitted if len(h.names) == 1][:2] if verdict.kind == "unknown" else []
        pairs = [(alone[0], alone[1])] if len(alone) == 2 else []
    one, other = min(pairs, key=lambda two: two[0].score - two[1].score, default=(best, None))
    if other is None or one.score - other.score >= DECIDED:
        return []
    return [one.fit.spec, other.fit.spec]


def next_for_equation(
    rivals: Sequence[Rival], evidence: SignalEvidence, *, designs: int = 30, seed: int = 0
) -> NextExperiment | None:
    """Return the run within the log's range that best distinguishes the two likeliest explanations of one equation."""
    log = evidence.log
    seconds = round(log.usual_seconds, 9)
    if len(rivals) < 2 or round(seconds / log.dt) < 50:
        return None
    driven = {name: u for name, u in evidence.driven().items() if np.ptp(u) > 0.0}
    if not driven:
        return None
    limits = PortLimits.of([(log, driven)], seconds=seconds, kinds=("sine",))
    rig = EquationRig(evidence.given, [evidence], limits)
    plan = plan_as_is(rig, list(rivals)[:2], designs, "discriminate", seed=seed)
    if not plan.runs:
        return None
    names = tuple(" and ".join(names) or "no effect" for names in plan.explanations)
    trajectory: dict[str, object] = {"kind": "run", "seconds": seconds}
    for name, wave in plan.runs[0].inputs.items():
        trajectory |= {name: wave.middle}
        if wave.amplitude:
            trajectory |= {f"{name}_amplitude": wave.amplitude, f"{name}_frequency": wave.frequency}
    nats = max(e.nats for e in plan.expected)
    reason = f"{names[0]} and {names[1]} would differ in log-likelihood by about {nats:.0f} over {seconds:.3g} s of it"
    return NextExperiment(trajectory, names, float(nats), reason)

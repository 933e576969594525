"""The run that a diagnosis of one equation proposes: signals within the range of its log."""

from __future__ import annotations

from collections.abc import Sequence

from ..diagnosis.findings import NextExperiment
from ..diagnosis.rivals import Rival
from ..residuals.single import SignalEvidence
from .port_family import PortLimits, within_limits
from .ports import EquationRig
from .search import plan_as_is


def next_for_equation(
    rivals: Sequence[Rival], evidence: SignalEvidence, *, designs: int = 30, seed: int = 0
) -> NextExperiment | None:
    """Return the run within the log's range that best distinguishes the two likeliest explanations of one equation."""
    log = evidence.log
    seconds = round(log.usual_seconds, 9)
    if len(rivals) < 2 or round(seconds / log.dt) < 50:
        return None
    limits = PortLimits.of([(log, evidence.driven())], seconds=seconds, kinds=("sine",))
    if not limits.ranges:
        return None
    rig = EquationRig(evidence.given, [evidence], within_limits(limits, {}, {}, {}, [], []))
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

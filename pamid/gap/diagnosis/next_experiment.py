"""What to record next: the run under which the two best explanations, each refitted, differ most."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ...bench import hold, isobaric, isometric, multisine, sealed_hold, simulate, sine, step, triangle
from ..residuals.bench import Evidence
from ..residuals.protocol import Spec
from ..settings import DECIDED
from .findings import NextExperiment

if TYPE_CHECKING:
    from ...bench.parameters import BenchParameters
    from ...bench.references import Trajectory
    from .decide import Verdict

SAMPLES = 2000
CHOICES: list[tuple[dict[str, Any], Callable[[], Trajectory]]] = [
    ({"kind": "sine", "frequency": 1.0, "amplitude": 15.0}, lambda: sine(1.0, 15.0, SAMPLES)),
    ({"kind": "sine", "frequency": 10.0, "amplitude": 15.0}, lambda: sine(10.0, 15.0, SAMPLES)),
    ({"kind": "triangle", "frequency": 1.0, "amplitude": 20.0}, lambda: triangle(1.0, 20.0, SAMPLES)),
    ({"kind": "step", "start": 0.0, "end": 20.0}, lambda: step(0.0, 20.0, SAMPLES)),
    ({"kind": "multisine", "frequency": 10.0, "amplitude": 10.0}, lambda: multisine(10.0, 10.0, SAMPLES)),
    ({"kind": "hold", "angle": 10.0}, lambda: hold(10.0, SAMPLES)),
    ({"kind": "sealed_hold", "angle": 10.0}, lambda: sealed_hold(10.0, SAMPLES)),
    ({"kind": "isobaric", "frequency": 4.0, "amplitude": 10.0}, lambda: isobaric(4.0, 10.0, SAMPLES)),
    ({"kind": "isometric", "angle": 0.0, "rise": 1e5}, lambda: isometric(0.0, 1e5, SAMPLES)),
]


def next_experiment(
    evidence: Evidence, verdict: Verdict, params: BenchParameters, here: Callable[[Spec], Spec] = dict
) -> tuple[NextExperiment | None, tuple[str, ...]]:
    """Return the next run to record and the two explanations that it separates, or None."""
    two = _rivals(verdict)
    if two is None:
        return None, ()
    specs = here(two[0]), here(two[1])
    names = _apart(specs[0], specs[1]), _apart(specs[1], specs[0])
    if not names[0] or not names[1]:
        return None, ()
    bench = evidence.corrected(specs[0])
    try:
        log = simulate(bench, [make() for _, make in CHOICES], seed=0)
    except (ValueError, FloatingPointError, ArithmeticError):
        return None, ()
    columns = [c for c in log.columns if c in _COLUMNS]
    for channel in ("F", "mdot"):
        if not evidence.reads(channel):
            columns = [c for c in columns if not c.startswith(channel)]
    trial = Evidence(log[columns], params)
    difference = trial.z(specs[1]) - trial.z(specs[0]) if specs[1] else trial.z0 - trial.z(specs[0])
    expected = np.zeros(len(trial.trajectories))
    amplitude = trial.z(specs[1]) - trial.z0 if specs[1] else np.zeros(len(difference))
    for t in range(len(expected)):
        rows = trial.block == t
        # What tolerances and the rival's own size explain is not a difference.
        A = np.column_stack([trial.J[rows], amplitude[rows]])
        d = difference[rows]
        A = A[:, np.any(A != 0, axis=0)]
        if A.shape[1]:
            d = d - A @ np.linalg.lstsq(A, d, rcond=None)[0]
        expected[t] = 0.5 * float(np.sum(np.minimum(np.square(d), 100.0)))
    best = int(np.argmax(expected))
    if expected[best] < 3.0:
        return None, names
    chosen = next(c for (c, make) in CHOICES if make().name == trial.trajectories[best])
    reason = (
        f"{names[0]} and {names[1]}, each refitted, would differ in log-likelihood by about {expected[best]:.0f} "
        f"over a run of {SAMPLES / 1000:g} s"
    )
    return NextExperiment(dict(chosen), names, float(expected[best]), reason), names


_COLUMNS = ("trajectory", "time", "q_ref", "q", "u1", "u2", "P1", "P2", "F1", "F2", "mdot1", "mdot2")


def _apart(spec: Spec, other: Spec) -> str:
    """Return the effect that one explanation has and another lacks; none where they are the same."""
    return next((name for name in spec if name not in other), "")


def _rivals(verdict: Verdict) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Return the two explanations closest to each other; None where one is clearly ahead."""
    best = verdict.outcome.best
    if verdict.named:
        found = []
        for name, ranked in verdict.outcome.alternatives.items():
            others = [h for h in ranked if name not in h.names]
            if others:
                found.append((best.score - others[0].score, others[0]))
        if not found:
            return None
        apart, other = min(found, key=lambda f: f[0])
        return None if apart > DECIDED else (best.fit.spec, other.fit.spec)
    if verdict.kind == "unknown":
        two = [h for h in verdict.outcome.refitted if len(h.names) == 1][:2]
        if len(two) == 2 and two[0].score - two[1].score < DECIDED:
            return two[0].fit.spec, two[1].fit.spec
    return None

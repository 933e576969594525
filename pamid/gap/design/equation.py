"""The next run for one equation: motions and pressures within what the log has visited."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...simulators.base import Simulator
from ..diagnosis.findings import NextExperiment
from ..diagnosis.rivals import Rival
from ..inference.gauss_newton import Fit
from ..one_equation import Gathered, Measured, gather
from ..residuals.rates import with_rates
from ..residuals.single import SignalEvidence
from .plan import Plan
from .port_family import PortInputs, PortLimits
from .ports import with_changes, within_limits
from .search import planned

if TYPE_CHECKING:
    import pandas as pd

MOVED = ("position", "pressure", "command")
"""Signals that a run may move."""


@dataclass(frozen=True)
class EquationRig(PortInputs):
    """One equation, for a design; a `pamid.gap.design.rig.Rig`."""

    m: Measured
    """The equation on the logs."""
    logs: Sequence[SignalEvidence]
    """Its evidence."""
    limits: PortLimits
    """What the signals that a run moves allow."""
    noise: float
    """Standard deviation of a window's noise."""

    def recorded(self, runs: Sequence[Any], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with their indices."""
        import pandas as pd

        last, t, rng = self.logs[-1], runs[0].time, np.random.default_rng(0)
        codes = np.repeat(np.arange(len(runs)), len(t))
        made = {role: np.full(len(codes), float(np.median(x))) for role, x in self.m.signals.items()}
        each = [run.values() for run in runs]
        moved = {role: name for role, name in self.m.columns.items() if name in each[0]}
        for role, name in moved.items():
            made[role] = np.concatenate([given[name] for given in each])
        if "time" in made:
            made["time"] = np.tile(t, len(runs))
        for rate, of in (("velocity", "position"), ("pressure_rate", "pressure")):
            if rate in made and of in moved:
                made[rate] = with_rates({of: made[of]}, codes, self.m.dt)[rate]
        found = self._on(made, self.m.usual(len(codes))(made), codes)
        y = found.predicted + found.added(truth.spec)
        y = y + self.noise * np.sqrt(last.n) * rng.standard_normal(len(y))
        return pd.DataFrame({"trajectory": codes.astype(str), **made, "y": y}), list(range(len(runs)))

    def evidence(self, table: pd.DataFrame) -> SignalEvidence:
        """Return the evidence of a log, made like that of the logs."""
        signals = {role: table[role].to_numpy() for role in self.m.signals}
        runs = table["trajectory"].to_numpy()
        return self._on(signals, table["y"].to_numpy(), np.cumsum(np.append(False, runs[1:] != runs[:-1])))

    def _on(self, signals: dict[str, np.ndarray], y: np.ndarray, codes: np.ndarray) -> SignalEvidence:
        m, last = self.m, self.logs[-1]
        found = SignalEvidence(
            signals, y, m.usual(len(y)), codes, m.dt, m.equation, m.plant, last.scales, m.units, m.columns
        )
        found.assume(self.noise * float(np.sqrt(last.n / found.n)))
        found.weights, found.stretch = last.weights, last.stretch
        return found


def limits_of(m: Measured, **given: Any) -> PortLimits:
    """Return the limits within which the signals of an equation moved that a run may move."""
    may_move = MOVED[:1] if m.equation == "torque" else MOVED  # a joint's load follows from its motion
    log = m.log
    inputs = {m.columns[role]: log.channels[m.columns[role]] for role in may_move if role in m.columns}
    return PortLimits.of([log], inputs, **given)


def next_for_equation(
    rivals: Sequence[Rival], m: Measured, gathered: Gathered, *, designs: int = 30, seed: int = 0
) -> NextExperiment | None:
    """Return the run that best distinguishes the two likeliest explanations of one equation.

    Each signal that is driven is held, or moves as a sine, within what the log has visited.
    """
    seconds = round(float(np.median(np.bincount(m.codes))) * m.dt, 9)
    if len(rivals) < 2 or round(seconds / m.dt) < 50 or not (limits := limits_of(m, seconds=seconds)).ranges:
        return None
    limits = replace(within_limits(limits, {}, {}, {}, [], []), kinds=("sine",))
    rig = EquationRig(m, [gathered.evidence], limits, gathered.noise)
    plan = planned(rig, list(rivals)[:2], designs, "discriminate", [], seed, lambda _: None)
    if not plan.runs:
        return None
    names = tuple(" and ".join(names) or "no effect" for names in plan.explanations)
    roles = {name: role for role, name in m.columns.items()}
    trajectory: dict[str, object] = {"kind": "run", "seconds": seconds}
    for name, wave in plan.runs[0].inputs.items():
        trajectory |= {roles[name]: wave.middle}
        if wave.amplitude:
            trajectory |= {f"{roles[name]}_amplitude": wave.amplitude, f"{roles[name]}_frequency": wave.frequency}
    nats = max(e.nats for e in plan.expected)
    reason = f"{names[0]} and {names[1]} would differ in log-likelihood by about {nats:.0f} over {seconds:.3g} s of it"
    return NextExperiment(trajectory, names, float(nats), reason)


def plan_equation_run(
    rivals: Sequence[Rival], logs: Mapping[str, pd.DataFrame], simulator: Simulator, library: Sequence[str],
    *, limits: Mapping[str, tuple[float, float]] | None = None, rates: Mapping[str, float] | None = None,
    keep: Mapping[str, tuple[float, float]] | None = None, changes: Sequence[Mapping[str, float]] = (),
    seconds: float | None = None, runs: int = 1, designs: int = 200, purpose: str = "auto", seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Plan:  # fmt: skip
    """Return the runs of a simulator that states its equation that best discriminate between explanations."""
    import pandas as pd
    from threadpoolctl import threadpool_limits

    say = progress or (lambda _: None)
    say("read the logs")
    log = pd.concat([x.assign(trajectory=[f"{n}: {run}" for run in x["trajectory"]]) for n, x in logs.items()])
    log = log.reset_index(drop=True)
    simulator = simulator.problem(log).fitted or simulator
    m = Measured.of(simulator.problem(log))
    allowed = limits_of(m, runs=runs, seconds=seconds or round(runs * float(np.median(np.bincount(m.codes))) * m.dt, 9))
    allowed = within_limits(allowed, limits or {}, rates or {}, keep or {}, list(allowed.ranges), [])
    with threadpool_limits(1):
        without, _ = m.checked()
        gathered = gather(m, library, simulator.sense, without)

        def under(change: Mapping[str, float], looked: int) -> Plan:
            changed, own = Measured.of(simulator.with_(change).problem(log)) if change else m, gathered.evidence
            return planned(
                EquationRig(changed, [own], allowed, gathered.noise), rivals, looked, purpose, library, seed, say
            )

        return with_changes(under, simulator, changes, designs, say) if changes else under({}, designs)

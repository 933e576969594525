"""The next run of any simulator with ports: its inputs within their limits, and changes of the rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...errors import ExcitationError, ParameterError
from ...names import refuse_others
from ...simulators.base import Simulator
from ...simulators.play_runs import played
from ...simulators.sizes import SignalSizes
from ..diagnosis.rivals import Rival
from ..inference.gauss_newton import Fit
from ..one_equation import fitted_together
from ..residuals.ports import PortEvidence
from ..residuals.shooting import ShootingEvidence
from ..residuals.single import SignalEvidence
from ..settings import SEARCH_ROWS
from ..simulated import evidence_of
from .equation import EquationRig
from .known import cleaned
from .plan import AS_IT_IS, Plan
from .port_family import PortInputs, PortLimits, PortRun, within_limits
from .rig import Rig
from .search import planned

if TYPE_CHECKING:
    import pandas as pd

TIMES = 0.5, 2.0
"""Other values of a parameter, as multiples, that are tried where no run distinguishes and no change is declared."""
MOST_PROPOSED, FEW = 6, 30
"""Number of parameters for which they are tried, and of designs evaluated then."""
DESIGNS = 200
"""Number of designs evaluated otherwise."""
ROOM = 1.0
"""How far beyond the range of the logs, in such ranges, a run may take readings: a rig may have stops there."""


@dataclass(frozen=True)
class PortRig(PortInputs):
    """A simulator with ports, for a design; a `pamid.gap.design.rig.Rig`."""

    simulator: Simulator
    """The simulator."""
    logs: Sequence[PortEvidence]
    """The logs of its present state."""
    limits: PortLimits
    """What its inputs allow."""
    numbers: Mapping[str, float]
    """Parameters that are changed for the runs."""
    noise: Mapping[str, float]
    """Noise of each equation over that of the readings, see `noise_of`."""

    @cached_property
    def _begins(self) -> np.ndarray:
        """Where the states begin, as in the logs."""
        last = self.logs[-1]
        signals = last.signals()
        return np.array(
            [
                float(np.median(signals[s][last.log.starts])) if s in signals else self.simulator.port(s).begins
                for s in self.simulator.states
            ]
        )

    @cached_property
    def _kept(self) -> dict[str, tuple[float, float]]:
        """The range in which each reading is to stay."""
        found = {}
        for name in self._read:
            x = np.concatenate([e.log.channels[name] for e in self.logs if name in e.log.channels])
            low, high = float(np.min(x)), float(np.max(x))
            found[name] = low - ROOM * (high - low), high + ROOM * (high - low)
        return {**found, **{n: r for n, r in self.limits.keeps.items() if n in found}}

    @property
    def _read(self) -> list[str]:
        return [n for n in self.logs[-1].log.channels if n not in self.simulator.inputs]

    def recorded(self, runs: Sequence[PortRun], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with the indices of those that stay within the known range."""
        import pandas as pd

        last, rng = self.logs[-1], np.random.default_rng(0)
        numbers = last.numbers(dict(zip(last.free, map(float, truth.x), strict=True)))
        for name, value in self.numbers.items():
            k = list(self.simulator.parameters).index(name)
            numbers[k] = value * numbers[k] / self.simulator.get(name) if self.simulator.get(name) else value
        active, steps = last.active(truth.spec), int(getattr(last, "substeps", 1))
        usual = {p.name: p.begins for p in self.simulator.ports if p.kind == "input"}
        usual |= {n: float(np.median(last.log.channels[n])) for n in usual if n in last.log.channels}
        noise = {n: last.channel_noise(n) for n in self._read}
        columns = {p.name: p.source for p in self.simulator.ports}
        tables, there, t = [], [], runs[0].time
        u = np.empty((len(runs), len(self.simulator.inputs), len(t)))
        for k, run in enumerate(runs):
            given = run.values()
            for j, name in enumerate(self.simulator.inputs):
                u[k, j] = given.get(name, usual[name])
        for k, found in enumerate(played(self.simulator, t, u, self._begins, numbers, active, last.joints, steps)):
            if not all(self._stays(n, found[n]) for n in self._read):
                continue
            noisy = {columns[n]: found[n] + noise[n] * rng.standard_normal(len(t)) for n in self._read}
            known = {columns[n]: found[n] for n in self.simulator.inputs}
            tables.append(pd.DataFrame({"trajectory": str(k), "time": t, **known, **noisy}))
            there.append(k)
        if not tables:
            raise ExcitationError(
                "No design within the limits keeps the readings near their range in the logs.",
                "limits within which the simulator stays near the logs",
                "Narrow --limit, widen --keep, or shorten --seconds.",
            )
        return pd.concat(tables, ignore_index=True), there

    def _stays(self, name: str, x: np.ndarray) -> bool:
        low, high = self._kept[name]
        return bool(np.all(np.isfinite(x)) and np.min(x) >= low and np.max(x) <= high)

    def evidence(self, table: pd.DataFrame) -> PortEvidence:
        """Return the evidence of a log, made like that of the logs."""
        last = self.logs[-1]
        simulator = self.simulator.with_(dict(self.numbers)) if self.numbers else self.simulator
        found = evidence_of(table, simulator, simulated=isinstance(last, ShootingEvidence))
        found.begin_as(last)
        found.measure_as(last.sizes)
        found.widen(self.noise)
        found.without_nuisances()
        return found


def noise_of(logs: Sequence[PortEvidence], rivals: Sequence[Rival]) -> dict[str, float]:
    """Return the noise of each equation over that of the readings, by the residuals of the likeliest explanation."""
    found: dict[str, list[float]] = {}
    for log in logs if rivals else ():
        x = np.array([float(rivals[0].deviations.get(name, 0.0)) for name in log.free])
        left = cleaned(log)(log.tangent(rivals[0].effects, x) + log.slopes(rivals[0].effects, x) @ x)
        for equation, part in zip(log.equations, log.parts, strict=True):
            if part.stop > part.start:  # the median of |x| is 0.6745 standard deviations
                found.setdefault(equation, []).append(float(np.median(np.abs(left[part]))) / 0.6745)
    return {equation: max(1.0, float(np.median(sizes))) for equation, sizes in found.items()}


def plan_port_run(
    rivals: Sequence[Rival],
    logs: Mapping[str, pd.DataFrame],
    simulator: Simulator,
    *,
    limits: Mapping[str, tuple[float, float]] | None = None,
    rates: Mapping[str, float] | None = None,
    keep: Mapping[str, tuple[float, float]] | None = None,
    changes: Sequence[Mapping[str, float]] = (),
    seconds: float | None = None,
    runs: int = 1,
    designs: int | None = None,
    purpose: str = "auto",
    library: str | Sequence[str] = "all",
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Return the runs of a simulator with ports that best discriminate between explanations."""
    from threadpoolctl import threadpool_limits

    say = progress or (lambda _: None)
    say("read the logs")
    states = fitted_together(logs, [simulator] * len(logs))[-1] if simulator.states_equation else simulator
    each = [evidence_of(log, states, refit=k == 0) for k, log in enumerate(logs.values())]
    sizes = SignalSizes.together([e.sizes for e in each])
    for one in each:
        one.begin_as(each[0])
        one.measure_as(sizes)
        one.without_nuisances()
    last, states_it = each[-1], simulator.states_equation
    allowed = PortLimits.of(
        [(e.log, e.driven()) for e in each], seconds=seconds or round(runs * last.log.usual_seconds, 9), runs=runs,
        columns={p.name: p.source for p in simulator.ports},
    )  # fmt: skip
    may_move = list(last.driven()) if states_it else simulator.inputs
    readings = [] if states_it else [*simulator.states, *simulator.outputs]
    allowed = within_limits(allowed, limits or {}, rates or {}, keep or {}, may_move, readings)
    wanted = [k for k in last.library(library) if last.has(k)]
    with threadpool_limits(1):
        known = [r for r in rivals if all(name in last.placements for name in r.effects)]
        noise = noise_of(each, known)

        def under(change: Mapping[str, float], looked: int) -> Plan:
            held = {n: v for n, v in change.items() if n in simulator.inputs}
            ranges = {n: r for n, r in allowed.ranges.items() if n not in held}
            within = replace(allowed, ranges=ranges, held=held)
            numbers = {n: v for n, v in change.items() if n not in held}
            rig: Rig = PortRig(simulator, each, within, numbers, noise)
            if isinstance(last, SignalEvidence):
                rig = EquationRig([e for e in each if isinstance(e, SignalEvidence)], within, numbers, noise)
            return planned(rig, known, looked, purpose, wanted, seed, say)

        rows = round(allowed.seconds / allowed.runs / last.log.dt)
        return with_changes(under, states, changes, designs or _usual_designs(simulator, rows), say)


def _usual_designs(simulator: Simulator, rows: int) -> int:
    """Return how many designs of so many rows are tried: fewer where each row is asked for by itself."""
    return int(np.clip(SEARCH_ROWS // max(rows, 1), FEW, DESIGNS)) if simulator.one_by_one else DESIGNS


def with_changes(
    under: Callable[[Mapping[str, float], int], Plan], simulator: Simulator, changes: Sequence[Mapping[str, float]],
    designs: int, say: Callable[[str], None],
) -> Plan:  # fmt: skip
    """Return the best plan, after a change of the rig where that tells more; `under` plans after a change."""
    plan = under({}, designs)
    if plan.purpose == "none":
        return plan
    told, proposed = {AS_IT_IS: plan.clarity}, not changes and not plan.tells and plan.purpose == "discriminate"
    for change in _proposals(simulator) if proposed else changes:
        _refuse_unknown(change, simulator)
        words = ", ".join(f"{n} = {v:g}" for n, v in change.items())
        say(f"with {words}")
        try:
            other = under(change, min(designs, FEW) if proposed else designs)
        except ExcitationError:
            told[words] = 0.0
            continue
        told[words] = other.clarity
        if not proposed and other.clarity > plan.clarity and (other.tells or not plan.tells):
            plan = replace(other, rig=dict(change))
    return replace(plan, changed=told if len(told) > 1 else {})


def _proposals(simulator: Simulator) -> list[dict[str, float]]:
    """Return changes of the rig to try where none was declared: other values of its parameters."""
    numbers = [(n, p.value) for n, p in simulator.parameters.items() if p.value][:MOST_PROPOSED]
    return [{name: float(f"{times * value:.3g}")} for name, value in numbers for times in TIMES]


def _refuse_unknown(change: Mapping[str, float], simulator: Simulator) -> None:
    known = [*simulator.parameters, *simulator.inputs]
    expected = f"a parameter of the simulator, or an input to hold: {', '.join(known)}"
    refuse_others(change, known, "A change of the system names", expected, error=ParameterError)

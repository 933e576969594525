"""Simulators with ports and equations as rigs: inputs within their limits, readings near the logs, changed numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import pandas as pd

from ...errors import ExcitationError, ParameterError
from ...names import refuse_others
from ...simulators.base import Simulator
from ...simulators.play_runs import played
from ...simulators.sizes import SignalSizes
from ..diagnosis.rivals import Rival
from ..inference.gauss_newton import Fit
from ..one_equation import fitted_together
from ..residuals.rates import with_rates
from ..residuals.single import SignalEvidence, Stated
from ..settings import SEARCH_ROWS
from ..simulated import evidence_of
from .known import cleaned, fit_of
from .port_family import PortLimits, PortRun
from .rig import DESIGNS, FEW, Rig

TIMES = 0.5, 2.0
"""Other values of a parameter, as multiples, that are tried where no run distinguishes and no change is declared."""
MOST_PROPOSED = 6
"""Number of parameters for which they are tried."""
ROOM = 1.0
"""How far beyond the range of the logs, in such ranges, a run may take readings: a rig may have stops there."""


@dataclass(frozen=True)
class PortRig(Rig):
    """A simulator with ports, for the planner."""

    simulator: Simulator
    """The simulator."""
    logs: Sequence[Any]
    """The logs of its present state."""
    limits: PortLimits
    """What its inputs allow."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Noise of each equation over that of the readings, see `noise_of`."""
    changes: Sequence[Mapping[str, float]] = ()
    """Changes of it that are possible: other values of parameters, inputs held at a value."""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """Parameters that are changed for the runs."""

    @property
    def designs(self) -> int:
        """Number of designs that are tried by default: fewer of long runs where each row is asked for by itself."""
        rows = round(self.limits.each / self.limits.interval)
        return int(np.clip(SEARCH_ROWS // max(rows, 1), FEW, DESIGNS)) if self.simulator.one_by_one else DESIGNS

    @property
    def proposals(self) -> Sequence[Mapping[str, float]]:
        """Changes to try where none is declared and no run distinguishes: other values of its parameters."""
        numbers = [(n, p.value) for n, p in self.simulator.parameters.items() if p.value][:MOST_PROPOSED]
        return [{name: float(f"{times * value:.3g}")} for name, value in numbers for times in TIMES]

    def changed(self, change: Mapping[str, float]) -> Self:
        """Return it with other parameters, and inputs held at a value."""
        known = [*self.simulator.parameters, *self.simulator.inputs]
        expected = f"a parameter of the simulator, or an input to hold: {', '.join(known)}"
        refuse_others(change, known, "A change of the system names", expected, error=ParameterError)
        held = {n: v for n, v in change.items() if n in self.simulator.inputs}
        ranges = {n: r for n, r in self.limits.ranges.items() if n not in held}
        numbers = {n: v for n, v in change.items() if n not in held}
        return replace(self, limits=replace(self.limits, ranges=ranges, held=held), numbers=numbers)

    def library(self, effects: str | Sequence[str]) -> list[str]:
        """Return those of some effects that may act on it."""
        last = self.logs[-1]
        return [k for k in last.library(effects) if last.has(k)]

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
        last, rng = self.logs[-1], np.random.default_rng(0)
        numbers = last.numbers(dict(zip(last.free, map(float, truth.x), strict=True)))
        for name, value in self.numbers.items():
            k = list(self.simulator.parameters).index(name)
            numbers[k] = value * numbers[k] / self.simulator.get(name) if self.simulator.get(name) else value
        active, steps = last.active(truth.spec), last.substeps if last.simulates else 1
        usual = {p.name: p.begins for p in self.simulator.ports if p.kind == "input"}
        usual |= {n: float(np.median(last.log.channels[n])) for n in usual if n in last.log.channels}
        noise = {n: last.channel_noise(n) for n in self._read}
        columns = {p.name: p.source for p in self.simulator.ports}
        tables, there, t = [], [], runs[0].time
        each = [{n: np.broadcast_to(x, len(t)) for n, x in (usual | run.values()).items()} for run in runs]
        u = np.array([[given[n] for n in self.simulator.inputs] for given in each])
        system = numbers, active, last.joints, steps
        for k, found in enumerate(played(self.simulator, t, u, self._begins, *system)):
            if not self._stays(found):
                continue
            noisy = {columns[n]: found[n] + noise[n] * rng.standard_normal(len(t)) for n in self._read}
            known = {columns[n]: found[n] for n in self.simulator.inputs}
            tables.append(pd.DataFrame({"trajectory": str(k), "time": t, **known, **noisy}))
            there.append(k)
        if not tables:
            run, signals, states = slice(*last.log.spans[-1]), last.signals(), self.simulator.states
            given = np.array([[signals[n][run] for n in self.simulator.inputs]])
            begins = [signals[s][run.start] if s in signals else x for s, x in zip(states, self._begins, strict=True)]
            (again,) = played(self.simulator, last.log.t[run], given, np.array(begins), *system)
            raise _left(alone=not self._stays(again))
        return pd.concat(tables, ignore_index=True), there

    def _stays(self, found: Mapping[str, np.ndarray]) -> bool:
        """Return whether a run keeps each reading in its range."""
        ranges = ((found[n], self._kept[n]) for n in self._read)
        return all(np.all(np.isfinite(x)) and np.min(x) >= low and np.max(x) <= high for x, (low, high) in ranges)

    def evidence(self, table: pd.DataFrame) -> Any:
        """Return the evidence of a log, made like that of the logs."""
        last = self.logs[-1]
        simulator = self.simulator.with_(dict(self.numbers)) if self.numbers else self.simulator
        found = evidence_of(table, simulator, simulated=last.simulates)
        found.begin_as(last)
        found.measure_as(last.sizes)
        found.widen(self.noise)
        found.without_nuisances()
        return found


def _left(alone: bool) -> ExcitationError:
    """Return the error of designs that all leave the range of the logs; `alone`: so does a logged run, simulated."""
    none = "No design within the limits keeps the readings near their range in the logs"
    if not alone:
        return ExcitationError(
            f"{none}.",
            "limits within which the simulator stays near the logs",
            "Narrow --limit, widen --keep, or shorten --seconds.",
        )
    return ExcitationError(
        f"{none}: the simulator leaves it under each of them, and even under the inputs of a logged run.",
        "a system that stays near the logs without a controller, since a design fixes the inputs before the run",
        "Make the run with the controller in the loop, move its set point, and continue with --since; if the system "
        "has no controller, widen --keep or shorten --seconds.",
    )


@dataclass(frozen=True)
class EquationRig(PortRig):
    """One equation of a system, for the planner: its signals move, and its noise is that of the logs."""

    def _stated(self, numbers: np.ndarray, table: Mapping[str, np.ndarray], starts: np.ndarray) -> Stated:
        """Return the equation on other rows, with other numbers but those that have been changed; nothing measured."""
        last = self.logs[-1]
        there = {**dict(zip(last.given.parameters, map(float, numbers), strict=False)), **self.numbers}
        found = last.stated(np.array(list(there.values())))
        return found._replace(equation=found.equation.on(table, starts), y=np.zeros(0))

    def recorded(self, runs: Sequence[PortRun], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with their indices."""
        last, t, rng = self.logs[-1], runs[0].time, np.random.default_rng(0)
        codes = np.repeat(np.arange(len(runs)), len(t))
        made = {role: np.full(len(codes), float(np.median(x))) for role, x in last.equation.table.items()}
        each = [run.values() for run in runs]
        moved = {role: name for role in made if (name := last.spoken(role)) in each[0]}
        for role, name in moved.items():
            made[role] = np.concatenate([given[name] for given in each])
        if "time" in made:
            made["time"] = np.tile(t, len(runs))
        for rate, of in (("velocity", "position"), ("pressure_rate", "pressure")):
            if rate in made and of in moved:
                made[rate] = with_rates({of: made[of]}, codes, last.log.dt)[rate]
        numbers = last.numbers(dict(zip(last.free, map(float, truth.x), strict=True)))
        there = self._stated(numbers, made, len(t) * np.arange(len(runs)))
        y = there.unit * there.equation.modelled(last.active(truth.spec))
        y = y + float(np.median(last.noise)) * np.sqrt(last.n) * rng.standard_normal(len(y))
        return pd.DataFrame({"trajectory": codes.astype(str), **made, "y": y}), list(range(len(runs)))

    def evidence(self, table: pd.DataFrame) -> SignalEvidence:
        """Return the evidence of a log, made like that of the logs."""
        last, runs = self.logs[-1], table["trajectory"].to_numpy()
        starts = np.flatnonzero(np.append(True, runs[1:] != runs[:-1]))
        rows = {role: table[role].to_numpy() for role in last.equation.table}

        def under(numbers: np.ndarray) -> Stated:
            found = self._stated(numbers, rows, starts)
            return found._replace(y=table["y"].to_numpy() / found.unit)

        found = SignalEvidence(
            under(last.given.numbers), runs[starts].tolist(), last.columns, last.position, last.contraction,
            simulator=last.given, under=under,
        )  # fmt: skip
        found.begin_as(last)
        found.measure_as(last.sizes)
        wanted = float(np.median(last.noise)) * np.sqrt(last.n / found.n)
        kind = last.equation.kind
        times = self.noise.get(kind, 1.0)
        found.widen({kind: times * wanted / float(np.median(found.noise))})
        found.weights, found.stretch = last.weights, last.stretch
        return found


def noise_of(logs: Sequence[Any], best: Rival) -> dict[str, float]:
    """Return the noise of each equation over that of the readings, by the residuals of the likeliest explanation."""
    found: dict[str, list[float]] = {}
    for log in logs:
        x = fit_of(best, log).x
        left = cleaned(log)(log.tangent(best.effects, x) + log.slopes(best.effects, x) @ x)
        for equation, part in zip(log.equations, log.parts, strict=True):
            if part.stop > part.start:  # the median of |x| is 0.6745 standard deviations
                found.setdefault(equation, []).append(float(np.median(np.abs(left[part]))) / 0.6745)
    return {equation: max(1.0, float(np.median(sizes))) for equation, sizes in found.items()}


def port_rig(
    simulator: Simulator,
    logs: Mapping[str, pd.DataFrame],
    rivals: Sequence[Rival],
    limits: Mapping[str, tuple[float, float]] | None = None,
    rates: Mapping[str, float] | None = None,
    keep: Mapping[str, tuple[float, float]] | None = None,
    changes: Sequence[Mapping[str, float]] = (),
    seconds: float | None = None,
    runs: int = 1,
) -> Rig:
    """Return a simulator of states, outputs or one equation with its logs, its inputs within limits."""
    one = simulator.states_equation
    states = fitted_together(logs, [simulator] * len(logs))[-1] if one else simulator
    each = [evidence_of(log, states, refit=k == 0) for k, log in enumerate(logs.values())]
    sizes, last = SignalSizes.together([e.sizes for e in each]), each[-1]
    for e in each:
        e.begin_as(each[0])
        e.measure_as(sizes)
        e.without_nuisances()
    limits, rates, keep = limits or {}, rates or {}, keep or {}
    inputs = list(last.driven()) if one else simulator.inputs
    readings = [] if one else [*simulator.states, *simulator.outputs]
    expected = f"an input: {', '.join(inputs)}"
    refuse_others({*limits, *rates}, inputs, "Limits are given for", expected, error=ParameterError)
    expected = f"a state or an output: {', '.join(readings) or 'none that a design predicts'}"
    refuse_others(keep, readings, "Ranges to keep are given for", expected, error=ParameterError)
    allowed = PortLimits.of(
        [(e.log, e.driven()) for e in each], limits, rates, keeps=dict(keep),
        seconds=seconds or round(runs * last.log.usual_seconds, 9), runs=runs,
        columns={p.name: p.source for p in simulator.ports}, units={p.name: p.unit for p in simulator.ports},
    )  # fmt: skip
    best = next((r for r in rivals if r.effects.keys() <= last.placements.keys()), None)
    noise = noise_of(each, best) if best else {}
    return (EquationRig if one else PortRig)(states, each, allowed, noise, changes)

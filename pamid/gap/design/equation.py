"""The next run for one equation: motions and pressures within the range of the log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..diagnosis.findings import NextExperiment
from ..diagnosis.rivals import Rival
from ..inference.gauss_newton import Fit
from ..residuals.rates import with_rates
from ..residuals.single import SignalEvidence, Stated
from .port_family import PortInputs, PortLimits, within_limits
from .search import planned

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class EquationRig(PortInputs):
    """One equation, for a design; a `pamid.gap.design.rig.Rig`."""

    logs: Sequence[SignalEvidence]
    """The equation on the logs."""
    limits: PortLimits
    """What the signals that a run moves allow."""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """Numbers that have been changed on the rig that is driven."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Noise of the equation over that of the readings."""

    def _stated(self, numbers: np.ndarray, table: Mapping[str, np.ndarray], starts: np.ndarray) -> Stated:
        """Return the equation on other rows, with other numbers but those that have been changed; nothing measured."""
        last = self.logs[-1]
        there = {**dict(zip(last.given.parameters, map(float, numbers), strict=False)), **self.numbers}
        found = last.stated(np.array(list(there.values())))
        return found._replace(equation=found.equation.on(table, starts), y=np.zeros(0))

    def recorded(self, runs: Sequence[Any], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with their indices."""
        import pandas as pd

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
    rig = EquationRig([evidence], within_limits(limits, {}, {}, {}, [], []))
    plan = planned(rig, list(rivals)[:2], designs, "discriminate", [], seed, lambda _: None)
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

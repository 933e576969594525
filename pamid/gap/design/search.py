"""Search the family of runs for those that best discriminate what a diagnosis left undecided."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...bench import Controller, simulate
from ...bench.sensors import Sensor
from ...errors import DivergedError, ExcitationError
from ..diagnosis.rivals import Rival
from ..inference.gauss_newton import Fit
from ..residuals.bench import Evidence
from .family import DesignedRun, Limits, draw, near
from .followed import controller_of
from .known import Known, known_of
from .plan import TELLS, Expected, Plan
from .rig import AnyRun, Rig
from .score import Discrimination, gained, right_first, shown
from .unseen import unseen

if TYPE_CHECKING:
    import pandas as pd

    from ...bench.parameters import BenchParameters
    from ...bench.references import Trajectory

WIDE = 0.6
"""Share of the designs that are drawn from the whole family; the others are drawn near the best of these."""
NEAR = 0.25, 0.1
"""Step sizes in turn, as shares of the limits."""
BEST = 5
"""Designs about which others are drawn."""
FINAL = 3
"""Designs that are compared with forms and with each explanation being the true one."""
RIVALS = 5
"""Explanations that are distinguished at once."""
DRAWS = 4
"""Draws of what could be true of an explanation, beside its best fit."""
SIMULATED = 0.1
"""Probability from which runs are also simulated with an explanation itself."""
NARROWS = 0.1
"""Gain in information about parameters, in nats, from which a run is worth its time: intervals narrower by a tenth."""
SAFER = 1e-3
"""Value of a factor e between the weakest pairs of two runs, in nats: a tie-breaker only."""
CHANNELS = ("q", "P", "F", "mdot")
SAMPLED = 5
"""Number of random runs that are evaluated like the best."""
Z80 = 1.2816


class Bench(NamedTuple):
    """The bench, for a design; a `pamid.gap.design.rig.Rig`."""

    params: BenchParameters
    """The simulator."""
    logs: Sequence[Evidence]
    """The logs of its present state."""
    limits: Limits
    """What it allows."""
    controller: Controller | None = None
    """What moves it; the simulator's own controller by default."""

    @property
    def kinds(self) -> Sequence[str]:
        """The kinds of runs that there can be."""
        return self.limits.kinds

    def draw(self, rng: np.random.Generator, kind: str) -> DesignedRun:
        """Draw a run of a kind."""
        return draw(rng, self.limits, kind)

    def near(self, rng: np.random.Generator, run: DesignedRun, share: float) -> DesignedRun:
        """Draw a run close to another one."""
        return near(rng, run, self.limits, share)

    def evidence(self, table: pd.DataFrame) -> Evidence:
        """Return a log of the bench, recorded or simulated, compared with its simulator."""
        return Evidence(table, self.params)

    def recorded(self, runs: Sequence[DesignedRun], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with the indices of those that could be simulated."""
        log = self.logs[-1]
        actual = log.corrected(truth.spec, dict(zip(log.free, map(float, truth.x), strict=True)))
        told = [run.trajectory(str(k)) for k, run in enumerate(runs)]
        table, there = self._simulated(actual, told, list(range(len(runs))))
        return table[[c for c in self.columns() if c in table]], there

    def _simulated(
        self, actual: BenchParameters, told: Sequence[Trajectory], which: list[int]
    ) -> tuple[pd.DataFrame, list[int]]:
        import pandas as pd

        try:
            runs = [told[k] for k in which]
            return simulate(actual, runs, seed=0, sensors=self.sensors, controller=self.controller), which
        except (DivergedError, ArithmeticError, ValueError):
            if len(which) == 1:
                return pd.DataFrame(), []
            half = len(which) // 2
            a, b = (self._simulated(actual, told, part) for part in (which[:half], which[half:]))
            parts = [t for t, there in (a, b) if there]
            if not parts and len(which) == len(told):
                raise ExcitationError(
                    "No design within the limits could be simulated with the likeliest explanation.",
                    "a bench that stays within its range",
                    "Narrow the limits of angle and pressure.",
                ) from None
            return (pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()), [*a[1], *b[1]]

    @property
    def sensors(self) -> dict[str, Sensor]:
        """The noise of the bench's own sensors, as its logs show it."""
        found: dict[str, list[float]] = {}
        for log in self.logs:
            for run in log.runs:
                for channel, noises in run.stretch.noises.items():
                    found.setdefault(channel, []).extend(float(np.hypot(n.white, n.fixed)) for n in noises)
        return {c: Sensor(float(np.median(v))) for c, v in found.items() if c in CHANNELS and np.median(v) > 0.0}

    def columns(self) -> list[str]:
        """The columns of a log that equations of the bench's logs read."""
        channels = [c for c in ("P", "F", "mdot", "u") if any(log.reads(c) for log in self.logs)]
        return ["trajectory", "time", "q", *(f"{c}{k}" for c in channels for k in (1, 2))]


def plan_next(
    rivals: Sequence[Rival],
    logs: Mapping[str, pd.DataFrame],
    params: BenchParameters,
    limits: Limits | None = None,
    *,
    designs: int = 200,
    purpose: str = "auto",
    library: Sequence[str] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Return the runs that best discriminate between explanations, or that best determine the parameters of one."""
    from threadpoolctl import threadpool_limits

    limits, say = limits or Limits(), progress or (lambda _: None)
    with threadpool_limits(1):
        say("read the logs")
        evidence = [Evidence(log, params) for log in logs.values()]
        bench = Bench(params, evidence, limits, controller_of(logs.values(), params))
        return planned(bench, rivals, designs, purpose, library, seed, say)


def planned(
    rig: Rig,
    rivals: Sequence[Rival],
    designs: int,
    purpose: str,
    library: Sequence[str],
    seed: int,
    say: Callable[[str], None],
) -> Plan:
    """Return the runs of a rig that best discriminate between explanations, or determine the parameters of one."""
    chosen = list(rivals)[:RIVALS]
    if purpose == "parameters" or (purpose == "auto" and len(chosen) == 1):
        chosen = [r for r in chosen if r.effects][:1]
    asked = "discriminate" if len(chosen) > 1 else "parameters"
    if not chosen and purpose != "parameters" and rivals:
        # There is no evidence for an effect. Those that would not have shown may still be present.
        chosen, asked = unseen(rig.logs, rivals[0], library, TELLS), "unseen"
        chosen = chosen if len(chosen) > 1 else []
    total = sum(r.belief for r in chosen) or 1.0
    chosen = [replace(r, belief=r.belief / total) for r in chosen]  # of those that are compared
    if not chosen:
        return Plan("none", [], rig.limits, [r.names for r in rivals], [r.belief for r in rivals], [], 0.0, False)
    rng = np.random.default_rng(seed)
    known = [_known(rig, r, rng, DRAWS if asked == "discriminate" else 0) for r in chosen]
    search = _Search(rig, known, asked, rng, say)
    search.look(designs)
    return search.plan()


def _known(rig: Rig, rival: Rival, rng: np.random.Generator, draws: int = 0) -> Known:
    free = rig.logs[-1].free
    x = np.array([float(rival.deviations.get(name, 0.0)) for name in free])
    fit = Fit({k: dict(v) for k, v in rival.effects.items()}, x, 0.0, np.zeros(0), np.ones(0))
    return known_of(rig.logs, fit, rival.belief, rng, draws)


class _Search:
    def __init__(
        self, rig: Rig, known: Sequence[Known], purpose: str, rng: np.random.Generator, say: Callable[[str], None]
    ) -> None:
        self.rig, self.known, self.limits, self.purpose = rig, list(known), rig.limits, purpose
        self.rng, self.say = rng, say
        self.beliefs = np.array([k.belief for k in known])
        self.found: list[tuple[float, AnyRun]] = []
        self.seen: list[tuple[AnyRun, pd.DataFrame]] = []
        self.looked, self.usual = 0, 0.0
        self.random: list[AnyRun] = []

    # --- one batch of designs -------------------------------------------------------------------------------
    def trial(self, runs: Sequence[AnyRun], truth: Known) -> tuple[Any, list[int]]:
        """Simulate runs with an explanation; runs that cannot be simulated are left out."""
        table, there = self.rig.recorded(runs, truth.fit)
        if truth is self.known[0]:
            self.seen += [(runs[int(str(name))], run) for name, run in table.groupby("trajectory", sort=False)]
        return self.rig.evidence(table), there

    def seen_again(self, runs: Sequence[AnyRun]) -> Any:
        """Return the designs evaluated so far, simulated with the likeliest explanation."""
        import pandas as pd

        of = [next(table for seen, table in self.seen if seen is run) for run in runs]
        parts = [table.assign(trajectory=str(k)) for k, table in enumerate(of)]
        return self.rig.evidence(pd.concat(parts, ignore_index=True))

    def scored(self, runs: Sequence[AnyRun]) -> list[tuple[float, AnyRun]]:
        """Return runs with how much each would tell, by a preview with the likeliest explanation."""
        trial, there = self.trial(runs, self.known[0])
        told = Discrimination(trial, self.known, forms=self.purpose == "parameters")
        self.looked += len(runs)
        return [(self._value(told, [k]), runs[at]) for k, at in enumerate(there)]

    def _value(self, told: Discrimination, chosen: Sequence[int]) -> float:
        if self.purpose == "parameters":
            return 0.5 * (told.information(chosen) - told.information([]))
        if self.purpose == "unseen":
            return shown(told.outlook(chosen))
        return self._worth(told.outlook(chosen))

    def _worth(self, outlook: np.ndarray) -> float:
        """Return the criterion of runs; among those that distinguish all, the separation of the weakest pair counts."""
        pairs = [float(np.median(outlook[i, j])) for i in range(len(outlook)) for j in range(len(outlook)) if i != j]
        return gained(outlook, self.beliefs) + SAFER * float(np.log1p(max(min(pairs), 0.0)))

    # --- the search -----------------------------------------------------------------------------------------
    def look(self, designs: int) -> None:
        """Evaluate designs: some of the whole family, then some near the best."""
        kinds = self.rig.kinds
        n = max(len(kinds), round(WIDE * designs))
        self.say("try runs of all kinds")
        self._take([self.rig.draw(self.rng, kinds[k % len(kinds)]) for k in range(n)])
        self.usual = float(np.median([value for value, _ in self.found])) if self.found else 0.0
        self.random = [run for run, _ in self.seen[:SAMPLED]]
        if more := max(designs - self.looked, 0):
            self.say("try runs near the best")
            best = [run for _, run in self.found[:BEST]]
            self._take([self.rig.near(self.rng, best[k % len(best)], NEAR[k // len(best) % 2]) for k in range(more)])

    def _take(self, runs: Sequence[AnyRun]) -> None:
        self.found = sorted([*self.found, *self.scored(runs)], key=lambda f: -f[0])

    # --- the answer -----------------------------------------------------------------------------------------
    def plan(self) -> Plan:
        """Compare the best designs with every explanation being the true one, and put them together."""
        pool = self._pool()
        self.say("compare the best")
        if self.limits.runs == 1:  # each as a separate log, as it will be
            told, runs = max(((self._told([run]), [run]) for run in pool), key=lambda f: self._together(f[0], [0]))
        else:
            runs = [pool[k] for k in self._greedy(self._told(pool), len(pool))]
            told = self._told(runs)
        chosen = list(range(len(runs)))
        names, beliefs = [k.names for k in self.known], [float(k.belief) for k in self.known]
        if self.purpose == "parameters":
            gain = self._value(told[0][0], chosen)
            shrinks = self._shrinks(told[0][0], chosen)
            tells = bool(gain > NARROWS)
            return Plan(
                self.purpose, runs if tells else [], self.limits, names, beliefs, [], gain, tells, shrinks=shrinks,
                designs=self.looked, usual=self.usual, closest=[] if tells else runs,
            )  # fmt: skip
        outlook = self._outlook(told, chosen)
        between, expected = self._expected(told, chosen, outlook)
        if self.purpose == "unseen":
            expected = [e for e in expected if e.truth and not e.rival]
            tells = any(e.nats >= TELLS for e in expected)
            return Plan(
                self.purpose, runs if tells else [], self.limits, names, beliefs, expected, shown(outlook), tells,
                designs=self.looked, usual=self.usual, closest=[] if tells else runs,
            )  # fmt: skip
        usual, right = self._at_random()
        pairs = [(i, j) for i in range(len(names)) for j in range(i)]
        alike = [(names[j], names[i]) for i, j in pairs if min(between[i, j], between[j, i]) < TELLS]
        top = max((min(between[0, j], between[j, 0]) for j in range(1, len(names))), default=0.0)
        tells = bool(top >= TELLS)
        needed = self.limits.seconds * TELLS / top if 0.03 * TELLS < top < TELLS else float("nan")
        return Plan(
            self.purpose, runs if tells else [], self.limits, names, beliefs, expected, gained(outlook, self.beliefs),
            tells, alike, needed, designs=self.looked, usual=usual, closest=[] if tells else runs,
            right=right_first(outlook, self.beliefs), right_usual=right,
        )  # fmt: skip

    def _told(self, runs: Sequence[AnyRun]) -> list[tuple[Discrimination, int]]:
        """Return the information of runs, simulated with each explanation that may well be true."""
        told = [(Discrimination(self.seen_again(runs), self.known), 0)]
        for i, truth in enumerate(self.known[1:], start=1):
            if self.purpose != "discriminate" or truth.belief < SIMULATED:
                continue
            with contextlib.suppress(ExcitationError):  # it would leave the limits: the first-order value is kept
                trial, there = self.trial(runs, truth)
                if len(there) == len(runs):
                    told.append((Discrimination(trial, self.known), i))
        return told

    def _at_random(self) -> tuple[float, float]:
        """Return the information of the runs drawn first, and how often the right explanation then comes first."""
        each = [Discrimination(self.seen_again([run]), self.known).outlook([0]) for run in self.random]
        told, rights = ([f(outlook, self.beliefs) for outlook in each] for f in (gained, right_first))
        return float(np.median(told)), float(np.median(rights))

    def _pool(self) -> list[AnyRun]:
        """Return the designs to evaluate exactly: the best, of several kinds where several runs are wanted."""
        wanted = max(FINAL, 3 * self.limits.runs) if self.limits.runs > 1 else FINAL
        pool: list[AnyRun] = []
        for kind in dict.fromkeys(run.kind for _, run in self.found):
            mine = [run for _, run in self.found if run.kind == kind]
            pool += mine[:2] if self.limits.runs > 1 else mine[:1]
        ranked = [run for _, run in self.found]
        pool = [run for run in ranked if run in pool][:wanted]
        return [*pool, *(run for run in ranked if run not in pool)][: max(wanted, self.limits.runs)]

    def _greedy(self, told: Sequence[tuple[Discrimination, int]], n: int) -> list[int]:
        """Return the runs that together tell most, added greedily."""
        chosen: list[int] = []
        while len(chosen) < min(self.limits.runs, n):
            free = [k for k in range(n) if k not in chosen]
            chosen.append(max(free, key=lambda k: self._together(told, [*chosen, k])))
        return chosen

    def _together(self, told: Sequence[tuple[Discrimination, int]], chosen: Sequence[int]) -> float:
        if self.purpose != "discriminate":
            return self._value(told[0][0], chosen)
        return self._worth(self._outlook(told, chosen))

    @staticmethod
    def _outlook(told: Sequence[tuple[Discrimination, int]], chosen: Sequence[int]) -> np.ndarray:
        """Return the differences draw by draw, each row from runs simulated with that explanation where they are."""
        of = {i: d for d, i in told}
        return np.array([of.get(i, told[0][0]).row(i, chosen) for i in range(told[0][0].m)])

    def _expected(
        self, told: Sequence[tuple[Discrimination, int]], chosen: Sequence[int], outlook: np.ndarray
    ) -> tuple[np.ndarray, list[Expected]]:
        between, spread = outlook[:, :, 0], np.std(outlook, axis=2)
        found = []
        for i, one in enumerate(self.known):
            for j, other in enumerate(self.known):
                if i == j:
                    continue
                D = max(float(between[i, j]), 0.0)  # below it by what sampling leaves
                reach = Z80 * float(np.hypot(np.sqrt(2.0 * D), spread[i, j]))
                prior = one.belief / max(one.belief + other.belief, 1e-12)
                odds = np.log(max(prior, 1e-9) / max(1.0 - prior, 1e-9)) + D
                where = next((d for d, k in told if k == i), told[0][0])
                equation, size = where.largest(i, j, chosen)
                found.append(
                    Expected(
                        one.names, other.names, D, max(D - reach, 0.0), D + reach, float(1.0 / (1.0 + np.exp(-odds))),
                        where.trial.equations[equation], size,
                    )
                )  # fmt: skip
        return between, found

    def _shrinks(self, told: Discrimination, chosen: Sequence[int]) -> dict[str, float]:
        """Return by how much the interval of each parameter of the explanation shrinks."""
        before, after = told.deviations([]), told.deviations(chosen)
        return {name: float(before[name] / after[name]) for name in after if after[name] > 0.0}

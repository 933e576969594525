"""The planner: search the runs of a rig for those that best tell what a diagnosis left undecided."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ...bench.parameters import BenchParameters
from ...errors import ExcitationError
from ..diagnosis.rivals import Rival
from ..residuals.protocol import ResidualSource
from ..settings import TOLERANCE
from .bench import bench_rig
from .expected_cost import expected_cost
from .known import Known, fit_of, known_of
from .plan import AS_IT_IS, TELLS, Expected, Plan
from .ports import port_rig
from .rig import FEW, Rig
from .score import Discrimination, gained, right_first, shown

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
HIDDEN = 6
"""Effects that one run is designed to show, of those that the logs so far could not have shown."""
SAMPLED = 5
"""Number of random runs that are evaluated like the best."""
Z80 = 1.2816

Say = Callable[[str], None]

rig_of = singledispatch(port_rig)
"""Returns the rig of a simulator and its logs; a new kind of simulator registers its own."""
rig_of.register(BenchParameters, bench_rig)


def plan_next(
    rivals: Sequence[Rival],
    logs: Mapping[str, pd.DataFrame],
    simulator: Any,
    limits: Any = None,
    *,
    designs: int | None = None,
    purpose: str = "auto",
    library: str | Sequence[str] = (),
    seed: int = 0,
    progress: Say | None = None,
    **options: Any,
) -> Plan:
    """Return the runs that best discriminate between explanations, or that best determine the parameters of one.

    The limits and further options are those of `pamid.gap.design.bench.bench_rig` or `pamid.gap.design.ports.port_rig`.
    """
    say = progress or (lambda _: None)
    with threadpool_limits(1):
        say("read the logs")
        rig = rig_of(simulator, logs, rivals, limits, **options)
        return planned(rig, rivals, designs or rig.designs, purpose, library, seed, say)


def planned(
    rig: Rig, rivals: Sequence[Rival], designs: int, purpose: str, library: str | Sequence[str], seed: int, say: Say
) -> Plan:
    """Return the best plan for a rig, after a change of it where that tells more."""
    plan = plan_as_is(rig, rivals, designs, purpose, library, seed, say)
    if plan.purpose == "none":
        return plan
    told, proposed = {AS_IT_IS: plan.clarity}, not rig.changes and not plan.tells and plan.purpose == "discriminate"
    for change in rig.proposals if proposed else rig.changes:
        changed, words = rig.changed(change), ", ".join(f"{n} = {v:g}" for n, v in change.items())
        say(f"with {words}")
        told[words] = 0.0
        with contextlib.suppress(ExcitationError):
            if proposed:  # a preview tells whether it is worth a plan
                told[words] = _searched(changed, rivals, min(designs, FEW), purpose, library, seed, say).promised
                continue
            other = plan_as_is(changed, rivals, designs, purpose, library, seed, say)
            told[words] = other.clarity
            if other.clarity > plan.clarity and (other.tells or not plan.tells):
                plan = replace(other, rig=dict(change))
    return replace(plan, changed=told if len(told) > 1 else {})


def plan_as_is(
    rig: Rig,
    rivals: Sequence[Rival],
    designs: int,
    purpose: str = "auto",
    library: str | Sequence[str] = (),
    seed: int = 0,
    say: Say = lambda _: None,
) -> Plan:
    """Return the runs of a rig that best discriminate between explanations, or determine the parameters of one."""
    search = _searched(rig, rivals, designs, purpose, library, seed, say)
    if search.known:
        return search.plan()
    there = _that_act(rig, rivals)
    return Plan("none", [], rig.limits, [r.names for r in there], [r.belief for r in there], [], 0.0, False)


def _that_act(rig: Rig, rivals: Sequence[Rival]) -> list[Rival]:
    """Return the explanations of which all effects can act on a rig's last log."""
    return [r for r in rivals if r.effects.keys() <= rig.logs[-1].effects.keys()]


def _searched(
    rig: Rig, rivals: Sequence[Rival], designs: int, purpose: str, library: str | Sequence[str], seed: int, say: Say
) -> "_Search":
    """Return the designs of a rig, ranked by a preview; of no explanations where there is nothing to tell apart."""
    rivals = _that_act(rig, rivals)
    chosen = rivals[:RIVALS]
    if purpose == "parameters" or (purpose == "auto" and len(chosen) == 1):
        chosen = [r for r in chosen if r.effects][:1]
    asked = "discriminate" if len(chosen) > 1 else "parameters"
    if not chosen and purpose != "parameters" and rivals:
        # There is no evidence for an effect. Those that would not have shown may still be present.
        chosen, asked = unseen(rig.logs, rivals[0], rig.library(library)), "unseen"
        chosen = chosen if len(chosen) > 1 else []
    total = sum(r.belief for r in chosen) or 1.0
    chosen = [replace(r, belief=r.belief / total) for r in chosen]  # of those that are compared
    rng = np.random.default_rng(seed)
    draws = DRAWS if asked == "discriminate" else 0
    known = [known_of(rig.logs, fit_of(r, rig.logs[-1]), r.belief, rng, draws) for r in chosen]
    search = _Search(rig, known, asked, rng, say)
    if known:
        search.look(designs)
    return search


def unseen(logs: Sequence[ResidualSource], base: Rival, library: Sequence[str]) -> list[Rival]:
    """Return no effect, and the effects that would hardly have shown in logs at their typical size."""
    found = []
    for name in library:
        if not any(log.touched([name]) for log in logs):
            continue  # no run shows an effect on a channel that no equation reads
        typical = {p.name: float(p.nominal) for p in logs[0].effects[name].parameters}
        cost = sum(_cost(log, {name: typical}, base) for log in logs)
        if cost < TELLS:
            found.append((cost, Rival({name: typical}, dict(base.deviations), 0.0, 0.0)))
    found.sort(key=lambda f: f[0])
    rivals = [base, *(rival for _, rival in found[:HIDDEN])]
    return [Rival(r.effects, r.deviations, r.score, 1.0 / len(rivals)) for r in rivals]


def _cost(log: ResidualSource, spec: dict[str, dict[str, float]], base: Rival) -> float:
    """Return the cost of omitting an effect from the simulator on a log, its tolerances refitted."""
    x = fit_of(base, log).x
    d = log.change(spec, {}, x)
    H = log.J.T @ log.J + TOLERANCE * np.eye(len(x))
    step = np.linalg.solve(H, log.J.T @ d)
    left = d - log.J @ step
    parts = [float(expected_cost(left[part, None], 0.0)[0][0]) for part in log.parts if part.stop > part.start]
    return sum(parts) + 0.5 * TOLERANCE * float(step @ step)


class _Search:
    def __init__(self, rig: Rig, known: Sequence[Known], purpose: str, rng: np.random.Generator, say: Say) -> None:
        self.rig, self.known, self.limits, self.purpose = rig, list(known), rig.limits, purpose
        self.rng, self.say = rng, say
        self.beliefs = np.array([k.belief for k in known])
        self.found: list[tuple[float, Any]] = []
        self.seen: list[tuple[Any, pd.DataFrame]] = []
        self.looked, self.usual = 0, 0.0
        self.random: list[Any] = []

    # --- one batch of designs -------------------------------------------------------------------------------
    def trial(self, runs: Sequence[Any], truth: Known) -> tuple[Any, list[int]]:
        """Simulate runs with an explanation; runs that cannot be simulated are left out."""
        table, there = self.rig.recorded(runs, truth.fit)
        if truth is self.known[0]:
            self.seen += [(runs[int(str(name))], run) for name, run in table.groupby("trajectory", sort=False)]
        return self.rig.evidence(table), there

    def seen_again(self, runs: Sequence[Any]) -> Any:
        """Return the designs evaluated so far, simulated with the likeliest explanation."""
        of = [next(table for seen, table in self.seen if seen is run) for run in runs]
        parts = [table.assign(trajectory=str(k)) for k, table in enumerate(of)]
        return self.rig.evidence(pd.concat(parts, ignore_index=True))

    def _take(self, runs: Sequence[Any]) -> None:
        """Rank runs among those found so far, by a preview with the likeliest explanation."""
        trial, there = self.trial(runs, self.known[0])
        told = Discrimination(trial, self.known, forms=self.purpose == "parameters")
        self.looked += len(runs)
        scored = [(self._value(told, [k]), runs[at]) for k, at in enumerate(there)]
        self.found = sorted([*self.found, *scored], key=lambda f: -f[0])

    def _value(self, told: Discrimination, chosen: Sequence[int]) -> float:
        if self.purpose == "parameters":
            return 0.5 * (told.information(chosen) - told.information([]))
        return shown(told.outlook(chosen)) if self.purpose == "unseen" else self._worth(told.outlook(chosen))

    def _worth(self, outlook: np.ndarray) -> float:
        """Return the criterion of runs; among those that distinguish all, the separation of the weakest pair counts."""
        pairs = [float(np.median(outlook[i, j])) for i in range(len(outlook)) for j in range(len(outlook)) if i != j]
        return gained(outlook, self.beliefs) + SAFER * float(np.log1p(max(min(pairs), 0.0)))

    # --- the search -----------------------------------------------------------------------------------------
    def look(self, designs: int) -> None:
        """Evaluate designs: some of the whole family, then some near the best."""
        kinds, limits = self.limits.kinds, self.limits
        n = max(len(kinds), round(WIDE * designs))
        self.say("try runs of all kinds")
        self._take([limits.draw(self.rng, kinds[k % len(kinds)]) for k in range(n)])
        self.usual = float(np.median([value for value, _ in self.found])) if self.found else 0.0
        self.random = [run for run, _ in self.seen[:SAMPLED]]
        if more := max(designs - self.looked, 0):
            self.say("try runs near the best")
            best = [run for _, run in self.found[:BEST]]
            self._take([limits.near(self.rng, best[k % len(best)], NEAR[k // len(best) % 2]) for k in range(more)])

    @property
    def promised(self) -> float:
        """What the best design tells by its preview."""
        return self.found[0][0] if self.found else 0.0

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
        said = self._narrowed(told[0], chosen) if self.purpose == "parameters" else self._compared(told, chosen)
        said = {"expected": [], "usual": self.usual, **said}
        return Plan(
            purpose=self.purpose, limits=self.limits, explanations=[k.names for k in self.known],
            beliefs=self.beliefs.tolist(), designs=self.looked,
            runs=runs if said["tells"] else [], closest=[] if said["tells"] else runs, **said,
        )  # fmt: skip

    def _narrowed(self, told: Discrimination, chosen: Sequence[int]) -> dict[str, Any]:
        """Return by how much runs narrow the parameters of the explanation."""
        gain, before, after = self._value(told, chosen), told.deviations([]), told.deviations(chosen)
        shrinks = {name: float(before[name] / after[name]) for name in after if after[name] > 0.0}
        return {"clarity": gain, "tells": bool(gain > NARROWS), "shrinks": shrinks}

    def _compared(self, told: Mapping[int, Discrimination], chosen: Sequence[int]) -> dict[str, Any]:
        """Return what runs show of each pair of explanations."""
        outlook, names = self._outlook(told, chosen), [k.names for k in self.known]
        between, expected = outlook[:, :, 0], self._expected(told, chosen, outlook)
        if self.purpose == "unseen":
            expected = [e for e in expected if e.truth and not e.rival]
            return {"clarity": shown(outlook), "tells": any(e.nats >= TELLS for e in expected), "expected": expected}
        usual, right = self._at_random()
        pairs = [(i, j) for i in range(len(names)) for j in range(i)]
        alike = [(names[j], names[i]) for i, j in pairs if min(between[i, j], between[j, i]) < TELLS]
        top = max((min(between[0, j], between[j, 0]) for j in range(1, len(names))), default=0.0)
        return {
            "clarity": gained(outlook, self.beliefs), "tells": bool(top >= TELLS), "expected": expected, "usual": usual,
            "alike": alike, "right": right_first(outlook, self.beliefs), "right_usual": right,
            "needed": self.limits.seconds * TELLS / top if 0.03 * TELLS < top < TELLS else float("nan"),
        }  # fmt: skip

    def _told(self, runs: Sequence[Any]) -> dict[int, Discrimination]:
        """Return the information of runs, simulated with each explanation that may well be true."""
        told = {0: Discrimination(self.seen_again(runs), self.known)}
        for i, truth in enumerate(self.known[1:], start=1):
            if self.purpose != "discriminate" or truth.belief < SIMULATED:
                continue
            with contextlib.suppress(ExcitationError):  # it would leave the limits: the first-order value is kept
                trial, there = self.trial(runs, truth)
                if len(there) == len(runs):
                    told[i] = Discrimination(trial, self.known)
        return told

    def _at_random(self) -> tuple[float, float]:
        """Return the information of the runs drawn first, and how often the right explanation then comes first."""
        each = [Discrimination(self.seen_again([run]), self.known).outlook([0]) for run in self.random]
        told, rights = ([f(outlook, self.beliefs) for outlook in each] for f in (gained, right_first))
        return float(np.median(told)), float(np.median(rights))

    def _pool(self) -> list[Any]:
        """Return the designs to evaluate exactly: the best, of several kinds where several runs are wanted."""
        several = self.limits.runs > 1
        wanted, ranked = max(FINAL, 3 * self.limits.runs) if several else FINAL, [run for _, run in self.found]
        pool: list[Any] = []
        for kind in dict.fromkeys(run.kind for run in ranked):
            pool += [run for run in ranked if run.kind == kind][: 2 if several else 1]
        pool = [run for run in ranked if run in pool][:wanted]
        return [*pool, *(run for run in ranked if run not in pool)][: max(wanted, self.limits.runs)]

    def _greedy(self, told: Mapping[int, Discrimination], n: int) -> list[int]:
        """Return the runs that together tell most, added greedily."""
        chosen: list[int] = []
        while len(chosen) < min(self.limits.runs, n):
            free = [k for k in range(n) if k not in chosen]
            chosen.append(max(free, key=lambda k: self._together(told, [*chosen, k])))
        return chosen

    def _together(self, told: Mapping[int, Discrimination], chosen: Sequence[int]) -> float:
        exact = self.purpose == "discriminate"
        return self._worth(self._outlook(told, chosen)) if exact else self._value(told[0], chosen)

    def _outlook(self, told: Mapping[int, Discrimination], chosen: Sequence[int]) -> np.ndarray:
        """Return the differences draw by draw, each row from runs simulated with that explanation where they are."""
        return np.array([told.get(i, told[0]).row(i, chosen) for i in range(len(self.known))])

    def _expected(
        self, told: Mapping[int, Discrimination], chosen: Sequence[int], outlook: np.ndarray
    ) -> list[Expected]:
        between, spread, found = outlook[:, :, 0], np.std(outlook, axis=2), []
        for i, one in enumerate(self.known):
            for j, other in enumerate(self.known):
                if i == j:
                    continue
                D = max(float(between[i, j]), 0.0)  # below it by what sampling leaves
                reach = Z80 * float(np.hypot(np.sqrt(2.0 * D), spread[i, j]))
                prior = one.belief / max(one.belief + other.belief, 1e-12)
                odds = np.log(max(prior, 1e-9) / max(1.0 - prior, 1e-9)) + D
                where = told.get(i, told[0])
                equation, size = where.largest(i, j, chosen)
                found.append(
                    Expected(
                        one.names, other.names, D, max(D - reach, 0.0), D + reach, float(1.0 / (1.0 + np.exp(-odds))),
                        where.trial.equations[equation], size,
                    )
                )  # fmt: skip
        return found

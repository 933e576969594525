"""Search the family of runs for those that best discriminate what a diagnosis left undecided."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

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
from .score import Discrimination, gained, shown
from .unseen import unseen

if TYPE_CHECKING:
    import pandas as pd

    from ...bench.parameters import BenchParameters
    from ...bench.references import Trajectory

WIDE = 0.6
"""Share of the designs that are drawn from the whole family; the others are drawn near the best of these."""
NEAR = 0.25, 0.1
"""How near, by turns, as shares of the limits."""
BEST = 5
"""Designs about which others are drawn."""
FINAL = 3
"""Designs that are compared with forms and with each explanation being the true one."""
RIVALS = 5
"""Explanations that are distinguished at once."""
DRAWS = 4
"""Draws of what could be true of an explanation, beside its best fit."""
SIMULATED = 0.1
"""Belief from which an explanation's own runs are simulated, to see them as it would make them."""
NARROWS = 0.1
"""Gain in information about parameters, in nats, from which a run is worth its time: intervals narrower by a tenth."""
CHANNELS = ("q", "P", "F", "mdot")
Z80 = 1.2816


class Bench(NamedTuple):
    """The bench as a design sees it.

    Parameters
    ----------
    params : BenchParameters
        The simulator.
    logs : sequence of Evidence
        The logs of its present state.
    controller : Controller or None
        What moves it; the simulator's own controller by default.
    """

    params: BenchParameters
    logs: Sequence[Evidence]
    controller: Controller | None = None

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
    """Return the runs that best discriminate between explanations, or that best determine the parameters of one.

    Parameters
    ----------
    rivals : sequence of Rival
        The explanations, `pamid.gap.Diagnosis.rivals`.
    logs : mapping of str to DataFrame
        The logs that they rest on, of the bench as it is now.
    params : BenchParameters
        The simulator, with its tolerances.
    limits : Limits, optional
        What the bench allows.
    designs : int, default=200
        Designs to look at.
    purpose : {"auto", "discriminate", "parameters"}, default="auto"
        What the runs are for; "auto" determines parameters where only one explanation is left.
    library : sequence of str, default=()
        Effects that may be there: where the logs speak for none, the runs are to show those that could not have shown.
    seed : int, default=0
        Seed of the designs.
    progress : callable, optional
        Called with a short text at each step.

    Returns
    -------
    Plan
        The runs, and what each outcome would mean.

    Raises
    ------
    ExcitationError
        No design could be simulated.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> from pamid.gap.design.search import plan_next
    >>> bench = BenchParameters.for_muscle("B")
    >>> log = simulate(bench, [sine(1, 10, 1500), sine(1.5, 8, 1500)], effects=["dead_volume"], seed=0)
    >>> found = diagnose(log, bench, ["dead_volume", "polytropic_exponent", "gas_temperature"])
    >>> plan = plan_next(found.rivals, {"log": log}, bench, designs=20)
    >>> len(plan.runs), plan.tells
    (1, True)
    """
    from threadpoolctl import threadpool_limits

    limits, say = limits or Limits(), progress or (lambda _: None)
    with threadpool_limits(1):
        say("read the logs")
        bench = Bench(params, [Evidence(log, params) for log in logs.values()], controller_of(logs.values(), params))
        chosen = list(rivals)[:RIVALS]
        if purpose == "parameters" or (purpose == "auto" and len(chosen) == 1):
            chosen = [r for r in chosen if r.effects][:1]
        asked = "discriminate" if len(chosen) > 1 else "parameters"
        if not chosen and purpose != "parameters" and rivals:
            # Nothing speaks for an effect. Those that would not have shown may be there all the same.
            chosen, asked = unseen(bench.logs, rivals[0], library, TELLS), "unseen"
            chosen = chosen if len(chosen) > 1 else []
        total = sum(r.belief for r in chosen) or 1.0
        chosen = [replace(r, belief=r.belief / total) for r in chosen]  # of those that are compared
        if not chosen:
            return Plan("none", [], limits, [r.names for r in rivals], [r.belief for r in rivals], [], 0.0, False)
        rng = np.random.default_rng(seed)
        known = [_known(bench, r, rng, DRAWS if asked == "discriminate" else 0) for r in chosen]
        search = _Search(bench, known, limits, asked, rng, say)
        search.look(designs)
        return search.plan()


def _known(bench: Bench, rival: Rival, rng: np.random.Generator, draws: int = 0) -> Known:
    free = bench.logs[-1].free
    x = np.array([float(rival.deviations.get(name, 0.0)) for name in free])
    fit = Fit({k: dict(v) for k, v in rival.effects.items()}, x, 0.0, np.zeros(0), np.ones(0))
    return known_of(bench.logs, fit, rival.belief, rng, draws)


class _Search:
    def __init__(
        self,
        bench: Bench,
        known: Sequence[Known],
        limits: Limits,
        purpose: str,
        rng: np.random.Generator,
        say: Callable[[str], None],
    ) -> None:
        self.bench, self.known, self.limits, self.purpose = bench, list(known), limits, purpose
        self.rng, self.say = rng, say
        self.sensors, self.columns = bench.sensors, bench.columns()
        self.beliefs = np.array([k.belief for k in known])
        self.found: list[tuple[float, DesignedRun]] = []
        self.seen: list[tuple[DesignedRun, pd.DataFrame]] = []
        self.looked = 0

    # --- one batch of designs -------------------------------------------------------------------------------
    def trial(self, runs: Sequence[DesignedRun], truth: Known) -> tuple[Evidence, list[int]]:
        """Simulate runs with an explanation; runs that cannot be simulated are left out."""
        log = self.bench.logs[-1]
        actual = log.simulator(truth.fit.spec, dict(zip(log.free, map(float, truth.fit.x), strict=True)))
        told = [run.trajectory(str(k)) for k, run in enumerate(runs)]
        table, there = self._simulated(actual, told, list(range(len(runs))))
        table = table[[c for c in self.columns if c in table]]
        if truth is self.known[0]:
            self.seen += [(runs[int(str(name))], run) for name, run in table.groupby("trajectory", sort=False)]
        return Evidence(table, self.bench.params), there

    def seen_again(self, runs: Sequence[DesignedRun]) -> Evidence:
        """Return what the likeliest explanation makes of designs that were looked at."""
        import pandas as pd

        of = [next(table for seen, table in self.seen if seen is run) for run in runs]
        parts = [table.assign(trajectory=str(k)) for k, table in enumerate(of)]
        return Evidence(pd.concat(parts, ignore_index=True), self.bench.params)

    def _simulated(
        self, actual: BenchParameters, told: Sequence[Trajectory], which: list[int]
    ) -> tuple[pd.DataFrame, list[int]]:
        import pandas as pd

        try:
            runs = [told[k] for k in which]
            return simulate(actual, runs, seed=0, sensors=self.sensors, controller=self.bench.controller), which
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

    def scored(self, runs: Sequence[DesignedRun]) -> list[tuple[float, DesignedRun]]:
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
        return gained(told.outlook(chosen), self.beliefs)

    # --- the search -----------------------------------------------------------------------------------------
    def look(self, designs: int) -> None:
        """Look at designs: some of the whole family, then some near the best."""
        kinds = self.limits.kinds
        n = max(len(kinds), round(WIDE * designs))
        self.say("look at runs of all kinds")
        self._take([draw(self.rng, self.limits, kinds[k % len(kinds)]) for k in range(n)])
        if more := max(designs - self.looked, 0):
            self.say("look near the best")
            best = [run for _, run in self.found[:BEST]]
            self._take(
                [near(self.rng, best[k % len(best)], self.limits, NEAR[k // len(best) % 2]) for k in range(more)]
            )

    def _take(self, runs: Sequence[DesignedRun]) -> None:
        self.found = sorted([*self.found, *self.scored(runs)], key=lambda f: -f[0])

    # --- the answer -----------------------------------------------------------------------------------------
    def plan(self) -> Plan:
        """Compare the best designs with every explanation being the true one, and put them together."""
        pool = self._pool()
        self.say("compare the best")
        told = [(Discrimination(self.seen_again(pool), self.known), 0)]
        others = [k for k in self.known[1:] if k.belief >= SIMULATED] if self.purpose == "discriminate" else []
        for truth in others:
            trial, there = self.trial(pool, truth)
            if len(there) == len(pool):
                told.append((Discrimination(trial, self.known), self.known.index(truth)))
        chosen = self._greedy(told, len(pool))
        runs = [pool[k] for k in chosen]
        names, beliefs = [k.names for k in self.known], [float(k.belief) for k in self.known]
        if self.purpose == "parameters":
            gain = self._value(told[0][0], chosen)
            shrinks = self._shrinks(told[0][0], chosen)
            tells = bool(gain > NARROWS)
            return Plan(
                self.purpose, runs if tells else [], self.limits, names, beliefs, [], gain, tells, shrinks=shrinks,
                designs=self.looked, closest=[] if tells else runs,
            )  # fmt: skip
        outlook = self._outlook(told, chosen)
        between, expected = self._expected(told, chosen, outlook)
        if self.purpose == "unseen":
            expected = [e for e in expected if e.truth and not e.rival]
            tells = any(e.nats >= TELLS for e in expected)
            return Plan(
                self.purpose, runs if tells else [], self.limits, names, beliefs, expected, shown(outlook), tells,
                designs=self.looked, closest=[] if tells else runs,
            )  # fmt: skip
        pairs = [(i, j) for i in range(len(names)) for j in range(i)]
        alike = [(names[j], names[i]) for i, j in pairs if min(between[i, j], between[j, i]) < TELLS]
        top = max((min(between[0, j], between[j, 0]) for j in range(1, len(names))), default=0.0)
        tells = bool(top >= TELLS)
        needed = self.limits.seconds * TELLS / top if 0.03 * TELLS < top < TELLS else float("nan")
        return Plan(
            self.purpose, runs if tells else [], self.limits, names, beliefs, expected, gained(outlook, self.beliefs),
            tells, alike, needed, designs=self.looked, closest=[] if tells else runs,
        )  # fmt: skip

    def _pool(self) -> list[DesignedRun]:
        """Return the designs that are looked at closely: the best, of several kinds where several runs are wanted."""
        wanted = max(FINAL, 3 * self.limits.runs) if self.limits.runs > 1 else FINAL
        pool: list[DesignedRun] = []
        for kind in dict.fromkeys(run.kind for _, run in self.found):
            mine = [run for _, run in self.found if run.kind == kind]
            pool += mine[:2] if self.limits.runs > 1 else mine[:1]
        ranked = [run for _, run in self.found]
        pool = [run for run in ranked if run in pool][:wanted]
        return [*pool, *(run for run in ranked if run not in pool)][: max(wanted, self.limits.runs)]

    def _greedy(self, told: Sequence[tuple[Discrimination, int]], n: int) -> list[int]:
        """Return the runs that tell most together, one added after the other."""
        chosen: list[int] = []
        while len(chosen) < min(self.limits.runs, n):
            free = [k for k in range(n) if k not in chosen]
            chosen.append(max(free, key=lambda k: self._together(told, [*chosen, k])))
        return chosen

    def _together(self, told: Sequence[tuple[Discrimination, int]], chosen: Sequence[int]) -> float:
        if self.purpose != "discriminate":
            return self._value(told[0][0], chosen)
        return gained(self._outlook(told, chosen), self.beliefs)

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
                D = float(between[i, j])
                reach = Z80 * float(np.hypot(np.sqrt(2.0 * max(D, 0.0)), spread[i, j]))
                prior = one.belief / max(one.belief + other.belief, 1e-12)
                odds = np.log(max(prior, 1e-9) / max(1.0 - prior, 1e-9)) + D
                where = next((d for d, k in told if k == i), told[0][0])
                equation, size = where.largest(i, j, chosen)
                found.append(
                    Expected(
                        one.names, other.names, D, max(D - reach, 0.0), D + reach, float(1.0 / (1.0 + np.exp(-odds))),
                        self.bench.logs[-1].equations[equation], size,
                    )
                )  # fmt: skip
        return between, found

    def _shrinks(self, told: Discrimination, chosen: Sequence[int]) -> dict[str, float]:
        """Return by how much the interval of each parameter of the explanation shrinks."""
        before, after = told.deviations([]), told.deviations(chosen)
        return {name: float(before[name] / after[name]) for name in after if after[name] > 0.0}

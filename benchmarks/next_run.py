"""The loop diagnose, record, diagnose again on withheld benches: designed runs against random ones and a standard list.

The first log holds two slow runs. Then every arm records one run of its own, all of equal length, even where one name
was left alone: it may be the wrong one. Pairs of causes and every fourth other case go on once more where no name is
left alone; the other cases have one round.

Run with ``python benchmarks/next_run.py --cases 30``, on several cores with ``--jobs``; a case takes about half a
minute of one core. Each leaves one file in ``--out``, so that a stopped run goes on where it was; ``--report`` only
prints what is there.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from joblib import Parallel, delayed

from benchmarks.withheld.catalogue import CONFUSABLE, VOCABULARY
from benchmarks.withheld.excitation import Reference
from benchmarks.withheld.generator import Case, Spec, generate, record_more
from benchmarks.withheld.judge import simulator
from benchmarks.withheld.runner import write_json

ARMS = ("designed", "random", "standard")
SUITES = ("confusable", "weak", "pairs")
SHARES = {"confusable": 0.55, "weak": 0.3, "pairs": 0.15}
LAYOUT = (2, 1400)
"""Runs of the first log, and samples a run with its lead."""
SECONDS, ROUNDS = 4.0, 2
EVERY = 4
"""Of cases with one cause, every so manyth has all rounds; the others have one."""
DESIGNS = 40
"""Designs that are looked at for each run."""
GROUP = 8
"""Cases that are generated together."""
WEAK, MILD = (0.17, 1.0), (0.3, 5.0)
"""How strong causes are, beside the noise of the sensors."""


def specs(suite: str, count: int, root: int) -> list[Spec]:
    """Return the cases of a suite; more of them keep those that are there already."""
    return [_spec(suite, k, root) for k in range(count)]


def _spec(suite: str, index: int, root: int) -> Spec:
    entropy = (root, 100 + SUITES.index(suite), index)
    rng = np.random.default_rng((*entropy, 0))
    muscle = str(rng.choice(["A", "B", "B", "C", "C"]))

    def size(span: tuple[float, float]) -> float:
        return float(np.exp(rng.uniform(math.log(span[0]), math.log(span[1]))))

    names = sorted(VOCABULARY)
    if suite == "confusable":
        pair = CONFUSABLE[index // 2 % len(CONFUSABLE)]
        return Spec(suite, index, entropy, muscle, {pair[index % 2]: size(MILD)}, poor=True)
    if suite == "weak":
        return Spec(suite, index, entropy, muscle, {names[7 * index % len(names)]: size(WEAK)}, poor=True)
    rivals = {frozenset(pair) for pair in CONFUSABLE}
    while True:
        one, two = map(str, rng.choice(names, 2, replace=False))
        if frozenset((one, two)) not in rivals:
            return Spec(suite, index, entropy, muscle, {one: size(MILD), two: size(MILD)}, poor=True)


# --- one arm --------------------------------------------------------------------------------------------------
class Arm:
    """One way of choosing runs, on one case."""

    def __init__(self, name: str, case: Case, first: Any, history: Any) -> None:
        self.name, self.case, self.found = name, case, first
        self.history = history
        self.rng = np.random.default_rng((*case.spec.entropy, 77))
        self.rounds: list[dict[str, Any]] = []
        self.plan: Any = None
        self.planned = 0.0

    def next_run(self) -> Reference:
        """Return the run to record next."""
        from pamid.gap.design.family import DesignedRun, Limits
        from pamid.gap.design.search import plan_next

        k = len(self.rounds)
        limits = Limits(seconds=SECONDS)
        run = STANDARD[k] if self.name == "standard" else limits.draw(self.rng, str(self.rng.choice(limits.kinds)))
        if self.name == "designed":
            began = time.process_time()
            self.plan = plan_next(
                self.found.rivals, self.history.logs, self.history.simulator, limits, designs=DESIGNS,
                library=self.history.library, seed=k,
            )  # fmt: skip
            self.planned = time.process_time() - began
            # Where nothing tells within the limits, what comes closest is recorded nevertheless.
            run = next(iter([*self.plan.runs, *self.plan.closest]), run)
        assert isinstance(run, DesignedRun)
        told = run.trajectory(f"{self.name}-{k + 1}-{run.kind}")
        self.run = run
        return Reference(told.name, told.q_ref, told.lead, told.pressure_offset, told.share, told.sealed)

    def take(self, log: Any) -> None:
        """Diagnose with the run that was recorded."""
        from pamid.errors import PamidError
        from pamid.gap.several.go_on import go_on

        before = self.found
        try:
            self.found = go_on(self.history, {f"round-{len(self.rounds) + 1}": log})
        except PamidError as error:  # counts as wrong
            nothing = dict.fromkeys(("right", "named", "one", "closed"), False)
            said = {"verdict": "error", "causes": [], "first": str(error), **nothing}
        else:
            said = _said(self.found, self.case)
        said["run"] = self.run.as_dict()
        if self.name == "designed":
            said["next_seconds"] = self.planned
            said["tells"] = bool(self.plan.tells)
            said["alike"] = [[list(names) for names in pair] for pair in self.plan.alike]
            said["realised"] = _realised(before, self.plan, self.history.logs, self.history.simulator, self.case)
        self.rounds.append(said)

    @property
    def done(self) -> bool:
        """Whether an engineer would stop: names that are no class after a further run, or all rounds are over."""
        most = rounds_of(self.case.spec.suite, self.case.spec.index)
        return len(self.rounds) >= most or (bool(self.rounds) and closed(self.found))


def rounds_of(suite: str, index: int) -> int:
    """Return how many further runs a case may have."""
    return ROUNDS if suite == "pairs" or index // 2 % EVERY == 0 else 1


def closed(found: Any) -> bool:
    """Return whether a diagnosis leaves nothing to distinguish: every cause has one name."""
    return found.verdict in ("cause", "several") and all(len(c.effects) == 1 for c in found.causes)


def _standard() -> list[Any]:
    from pamid.gap.design.family import DesignedRun

    return [
        DesignedRun("sine", SECONDS, frequency=10.0, amplitude=15.0),
        DesignedRun("steps", SECONDS, frequency=3.0, amplitude=20.0),
        DesignedRun("multisine", SECONDS, frequency=3.0, amplitude=15.0),
    ]


STANDARD: list[Any] = _standard()
"""What docs/recording.md asks for first, in its order: a fast sine, steps, a multisine."""


def _said(found: Any, case: Case) -> dict[str, Any]:
    true = set(case.spec.targets)
    heads = [c.effects[0] for c in found.causes]
    best = found.candidates[0].effect if found.candidates else ""
    return {
        "verdict": found.verdict,
        "causes": [list(c.effects) for c in found.causes],
        "first": best,
        "right": best in true and (len(true) > 1 or found.verdict != "none"),
        "named": set(heads) == true,
        "one": found.verdict == "cause" and len(found.causes[0].effects) == 1,
        "closed": closed(found),
    }


def _realised(before: Any, plan: Any, more: dict[str, Any], params: Any, case: Case) -> list[Any]:
    """Return predicted and realised differences in log-likelihood of the true explanation to its rivals."""
    from pamid.effects.registry import chosen_effects
    from pamid.gap.inference.competition import Competition
    from pamid.gap.residuals.bench import Evidence
    from pamid.gap.several.stacked import Log, StackedEvidence

    known = {frozenset(r.names): r for r in before.rivals}
    true = frozenset(case.spec.targets)
    if true not in known or plan.purpose != "discriminate" or not plan.runs:
        return []

    def scores(tables: dict[str, Any]) -> dict[frozenset[str], float]:
        stack = StackedEvidence([Log(n, Evidence(t, params), "one") for n, t in tables.items()])
        competition, out = Competition(stack, []), {}
        for names, r in known.items():
            x = np.array([r.deviations.get(k, 0.0) for k in stack.free])
            fit = competition.fitter.refine(r.effects, near=x) if r.effects else competition.fitter.base()
            out[names] = competition.hypothesis(fit).score
        return out

    further = float(np.log(len(chosen_effects("all", "bench"))))  # what each effect beyond the first had paid
    a = {names: r.score + further * max(len(names) - 1, 0) for names, r in known.items()}
    b = scores(more)
    pairs = [e for e in plan.expected if frozenset(e.truth) == true]
    return [
        [list(e.rival), e.nats, (b[true] - b[frozenset(e.rival)]) - (a[true] - a[frozenset(e.rival)]), e.low, e.high]
        for e in pairs
    ]


# --- all cases ------------------------------------------------------------------------------------------------
def examine(group: Sequence[Spec], folder: Path) -> None:
    """Run all arms on some cases, and write what came of each as soon as it is complete."""
    # A diagnosis names a run of a list, too, which no arm records.
    with mock.patch("pamid.gap.several.engine.next_experiment", lambda *_: (None, ())):
        cases = generate(group, LAYOUT)
        firsts, arms = {}, {}
        for case in cases:
            firsts[case.spec.name], arms[case.spec.name] = _begin(case)
        for turn in range(ROUNDS):
            live = {c.spec.name: [a for a in arms[c.spec.name] if not a.done] for c in cases}
            with_runs = [c for c in cases if live[c.spec.name]]
            for name in [c.spec.name for c in cases if not live[c.spec.name]]:
                _write(firsts[name], arms[name], folder)
            cases = with_runs
            if not cases:
                return
            plans = [[a.next_run() for a in live[c.spec.name]] for c in cases]
            longest = max(len(p) for p in plans)
            padded = [p + [p[-1]] * (longest - len(p)) for p in plans]
            for c, logs in zip(cases, record_more(cases, padded, turn), strict=True):
                for arm, log in zip(live[c.spec.name], logs, strict=False):
                    arm.take(log)
        for case in cases:
            _write(firsts[case.spec.name], arms[case.spec.name], folder)


def _begin(case: Case) -> tuple[dict[str, Any], list[Arm]]:
    """Diagnose the first log of a case, from which all arms go on."""
    from pamid.effects.registry import chosen_effects
    from pamid.gap.several.go_on import go_on
    from pamid.gap.several.history import History

    history = History(simulator(case.sim_toml), chosen_effects("all", "bench"))
    began = time.process_time()
    first = go_on(history, {"first": case.log})
    result = {
        "suite": case.spec.suite,
        "name": case.spec.name,
        "true": {k: v["strength"] for k, v in case.key["effects"].items()},
        "first": _said(first, case),
        "seconds": time.process_time() - began,
    }
    own = [
        History(history.simulator, history.library, dict(history.logs), dict(history.held), list(history.rounds))
        for _ in ARMS
    ]
    return result, [Arm(name, case, first, h) for name, h in zip(ARMS, own, strict=True)]


def _write(first: dict[str, Any], arms: Sequence[Arm], folder: Path) -> None:
    write_json(folder / f"{first['name']}.json", {**first, "arms": {a.name: a.rounds for a in arms}})


def _examine_unless_late(group: Sequence[Spec], folder: Path, until: float) -> str:
    if time.time() > until:
        return ""
    examine(group, folder)
    return f"{group[0].suite} to {group[-1].index}"


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark; return 0 when it is complete."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=30, metavar="N", help="cases an arm")
    parser.add_argument("--seed", type=int, default=417, help="seed of the cases")
    parser.add_argument("--suite", choices=SUITES, action="append", help="only this suite; may be repeated")
    parser.add_argument("--out", type=Path, default=Path("results/next_run"), metavar="DIR", help="where results go")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes")
    parser.add_argument("--minutes", type=float, default=math.inf, metavar="M", help="begin no further case after this")
    parser.add_argument("--report", action="store_true", help="print what is there already, run nothing")
    args = parser.parse_args(argv)
    folder = args.out / f"seed-{args.seed}"
    suites = args.suite or SUITES
    total = sum(SHARES[s] for s in suites)
    listed = [specs(s, max(1, round(args.cases * SHARES[s] / total)), args.seed) for s in suites]
    groups = [(k / len(cases), cases[k : k + GROUP]) for cases in listed for k in range(0, len(cases), GROUP)]
    # The suites take turns, so that a run that is stopped has cases of each.
    groups.sort(key=lambda g: g[0])
    missing = [[s for s in g if not (folder / f"{s.name}.json").is_file()] for _, g in groups if not args.report]
    began = time.time()
    work = (delayed(_examine_unless_late)(g, folder, began + 60.0 * args.minutes) for g in missing if g)
    for done in filter(None, Parallel(n_jobs=args.jobs, return_as="generator_unordered")(work)):
        print(f"{done}, {(time.time() - began) / 60:.1f} min", file=sys.stderr)
    names = {s.name for cases in listed for s in cases}
    found = [json.loads(p.read_text(encoding="utf-8")) for p in sorted(folder.glob("*.json")) if p.stem in names]
    if not found:
        print(f"There are no results in {folder}.", file=sys.stderr)
        return 1
    print(report(found, f"python benchmarks/next_run.py --cases {len(found)} --seed {args.seed}"))
    return 0 if len(found) == len(names) else 1


# --- the report -----------------------------------------------------------------------------------------------
def share(flags: Sequence[bool]) -> str:
    """Return a share with Wilson's 95 % interval."""
    n, k = len(flags), sum(flags)
    if not n:
        return "–"
    z, p = 1.96, k / n
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = ((middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n))
    return f"{100 * p:.0f} % ({100 * max(low, 0.0):.0f}–{100 * min(high, 1.0):.0f})"


def seconds_to_one(rounds: Sequence[dict[str, Any]]) -> float:
    """Return the seconds of recording after which the right effect is named alone; infinite if never."""
    return next((SECONDS * k for k, r in enumerate(rounds, 1) if r["one"] and r["right"]), math.inf)


def report(found: Sequence[dict[str, Any]], command: str) -> str:
    """Return the table of all arms."""
    single = [f for f in found if f["suite"] != "pairs"]
    pairs = [f for f in found if f["suite"] == "pairs"]
    left, pairs_left = ([f for f in part if not f["first"]["closed"]] for part in (single, pairs))
    long = [f for f in left if rounds_of(f["suite"], int(f["name"].rpartition("-")[2])) == ROUNDS]
    never = (ROUNDS + 1) * SECONDS

    def after(f: dict[str, Any], arm: str, turn: int) -> dict[str, Any]:
        rounds = f["arms"][arm][:turn]
        return dict(rounds[-1] if rounds else f["first"])

    def row(text: str, ask: str, cases: Sequence[Any], cell: Callable[[str], str]) -> str:
        return f"| {text} | {ask} | {len(cases)} | " + " | ".join(cell(arm) for arm in ARMS) + " |"

    def says(word: str, cases: Sequence[Any], turn: int) -> Callable[[str], str]:
        return lambda arm: share([bool(after(f, arm, turn)[word]) for f in cases])

    def one(cases: Sequence[Any], turn: int) -> Callable[[str], str]:
        return lambda arm: share([_one(after(f, arm, turn)) for f in cases])

    def wait(arm: str) -> str:
        seconds = [min(seconds_to_one(f["arms"][arm]), never) for f in long]
        return f"{np.mean(seconds):.1f}" if seconds else "–"

    lines = [
        f"`{command}`",
        "",
        "| figure | target | n | " + " | ".join(ARMS) + " |",
        "| --- | --- | --- | --- | --- | --- |",
        row("one cause: right effect first after the first log", "–", single, says("right", single, 0)),
        row(
            f"the same after one run of {SECONDS:g} s",
            "≥ 97 %",
            single,
            says("right", single, 1),
        ),
        row(
            "the same, or no run tells the first from the right one, as `next` said",
            "–",
            single,
            lambda arm: share([_right_or_alike(f) for f in single]) if arm == "designed" else "–",
        ),
        row("left open by the first log: right effect first then", "–", left, says("right", left, 0)),
        row("after one run", "random ≥ 8 points behind", left, says("right", left, 1)),
        row("right effect named alone after one run", "–", left, one(left, 1)),
        row("cases with two rounds: right effect first after two runs", "–", long, says("right", long, 2)),
        row("right effect named alone after two runs", "–", long, one(long, 2)),
        row(f"mean seconds until then (never: {never:g})", "≤ ⅓ of random, ≤ ½ of standard", long, wait),
        row("two causes: both named after the first log", "–", pairs, says("named", pairs, 0)),
        row("after one run", "–", pairs, says("named", pairs, 1)),
        row("after two runs", "≥ 97 %", pairs, says("named", pairs, 2)),
        row("two causes left open: both named after two runs", "–", pairs_left, says("named", pairs_left, 2)),
    ]
    shut = [f for f in single if f["first"]["closed"]]
    designed = [r for f in found for r in f["arms"]["designed"]]
    told = [p for r in designed for p in r.get("realised", [])]
    for text, some in (("", told), (", where 10 nats or more were predicted", [p for p in told if p[1] >= 10.0])):
        ratios = np.array([max(p[2], 1e-9) / max(p[1], 1e-9) for p in some])
        close = share([bool(0.5 <= r <= 2.0) for r in ratios])
        lines.append(
            f"| predicted and realised difference within a factor of two{text} | 80 % | {len(some)} | {close} | – | – |"
        )
        if some:
            low, mid, high = np.quantile(ratios, (0.1, 0.5, 0.9))
            spread = f"{mid:.2f} ({low:.2f}–{high:.2f})"
            lines.append(f"| realised over predicted{text}: median (10 to 90 %) | – | {len(some)} | {spread} | – | – |")
    inside = share([bool(p[3] <= p[2] <= p[4]) for p in told])
    lines.append(f"| realised difference inside the 80 % interval | 80 % | {len(told)} | {inside} | – | – |")
    if designed:
        cpu = [r["next_seconds"] for r in designed]
        took = f"{np.median(cpu):.1f} ({max(cpu):.1f})"
        lines.append(
            f"| CPU time of `next`, {DESIGNS} designs, s: median (largest) | – | {len(cpu)} | {took} | – | – |"
        )
    right = sum(f["first"]["right"] for f in shut)
    lines += [
        "",
        f"Of {len(single)} first logs with one cause {len(shut)} left one name alone, {right} of them the right one.",
        "",
    ]
    return "\n".join([*lines, *_kinds(left + pairs_left)])


def _kinds(found: Sequence[dict[str, Any]]) -> list[str]:
    """Return a table of what first runs of each kind did, whichever arm recorded them."""
    runs: dict[str, list[tuple[str, bool]]] = {}
    for f in found:
        for arm in ARMS:
            for r in f["arms"][arm][:1]:
                closes = r["named"] and r["closed"]
                runs.setdefault(r["run"]["kind"], []).append((arm, closes))
    ranked = sorted(runs.items(), key=lambda item: -sum(c for _, c in item[1]) / len(item[1]))
    lines = ["| kind of the first further run | designed | random | standard | closes the case, rightly |"]
    lines.append("| --- | --- | --- | --- | --- |")
    for kind, closed_by in ranked:
        count = Counter(arm for arm, _ in closed_by)
        lines.append(
            f"| {kind} | {' | '.join(str(count[a]) for a in ARMS)} | {share([c for _, c in closed_by])} of "
            f"{len(closed_by)} |"
        )
    return lines


def _right_or_alike(f: dict[str, Any]) -> bool:
    said = f["arms"]["designed"][0]
    pairs = [{tuple(names) for names in pair} for pair in said.get("alike", [])]
    return bool(said["right"]) or any({(true,), (said["first"],)} in pairs for true in f["true"])


def _one(said: dict[str, Any]) -> bool:
    return bool(said["one"] and said["right"])


if __name__ == "__main__":
    raise SystemExit(main())

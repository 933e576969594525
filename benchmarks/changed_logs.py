"""Causes that appear between two days on withheld benches: how many are found, and how many changes are false.

Two logs of a bench, on two days: valve and damping differ within their tolerances. In half of the cases the second day
has a cause that the first one lacks; in a quarter both have it; in a quarter neither has one. Run with
``python benchmarks/changed_logs.py --cases 40``; each case leaves one file in ``--out``, and a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd

from benchmarks.next_run import share
from benchmarks.withheld.catalogue import VOCABULARY
from benchmarks.withheld.excitation import draw_plan
from benchmarks.withheld.generator import Case, Spec, generate, record_more
from benchmarks.withheld.judge import simulator
from benchmarks.withheld.quantities import TOLERANCE
from benchmarks.withheld.runner import write_json

LAYOUT = (2, 1600)
"""Runs of each log, and samples a run with its lead."""
SIZES = (0.5, 10.0)
"""How strong causes are, beside the noise of the sensors."""
GROUP = 12
OF_THE_DAY = ("C", "bq")
"""Numbers of the bench that differ from day to day."""
KINDS = ("comes", "stays", "comes", "healthy")


def specs(count: int, root: int) -> list[Spec]:
    """Return the cases; more of them keep those that are there already."""
    found, names = [], sorted(VOCABULARY)
    for k in range(count):
        rng = np.random.default_rng((root, 200, k, 0))
        muscle = str(rng.choice(["A", "B", "B", "C", "C"]))
        size = float(np.exp(rng.uniform(*map(math.log, SIZES))))
        kind = KINDS[k % len(KINDS)]
        targets = {} if kind == "healthy" else {names[7 * (k // 2) % len(names)]: size}
        found.append(Spec(kind, k, (root, 200, k), muscle, targets))
    return found


def earlier(cases: Sequence[Case]) -> list[pd.DataFrame]:
    """Record each case's bench on an earlier day."""

    def that_day(d: Any) -> Any:
        rng = np.random.default_rng((*d.spec.entropy, 9))
        own = {k: float(TOLERANCE[k] * rng.uniform(-0.95, 0.95)) for k in OF_THE_DAY if k in d.offsets}
        return replace(d, offsets={**d.offsets, **own}, shapes={} if d.spec.suite == "comes" else d.shapes)

    plans = [draw_plan(np.random.default_rng((*c.spec.entropy, 8)), *LAYOUT) for c in cases]
    parts = record_more(cases, plans, 5, that_day)
    return [pd.concat(runs, ignore_index=True) for runs in parts]


def examine(group: Sequence[Spec]) -> list[dict[str, Any]]:
    """Diagnose the two logs of some cases."""
    from pamid.gap.several import diagnose_logs

    cases = generate(group, LAYOUT)
    results = []
    for case, before in zip(cases, earlier(cases), strict=True):
        began = time.process_time()
        found = diagnose_logs({"one": before, "two": case.log}, simulator(case.sim_toml))
        results.append(
            {
                "kind": case.spec.suite,
                "name": case.spec.name,
                "true": dict(case.spec.targets),
                "verdict": found.verdict,
                "causes": [list(c.effects) for c in found.causes],
                "changes": [{"effect": c.effect, "how": c.how, "log": c.log} for c in found.changes],
                "seconds": time.process_time() - began,
            }
        )
    return results


def report(found: Sequence[dict[str, Any]], command: str) -> str:
    """Return the table."""
    comes = [f for f in found if f["kind"] == "comes"]
    same = [f for f in found if f["kind"] != "comes"]

    def change(f: dict[str, Any], named: bool) -> bool:
        there = [c for c in f["changes"] if c["how"] in ("appears", "grows") and c["log"] == "two"]
        classes = [set(c) for c in f["causes"]]
        true = next(iter(f["true"]))
        return any(not named or c["effect"] == true or any({c["effect"], true} <= k for k in classes) for c in there)

    rows = [
        ("a cause comes on the second day: a change is found there", "≥ 95 %", comes, lambda f: change(f, False)),
        ("the cause, or a class that holds it, is what has changed", "≥ 95 %", comes, lambda f: change(f, True)),
        ("nothing changes: a change is named", "≤ 2 %", same, lambda f: bool(f["changes"])),
    ]
    lines = [f"`{command}`", "", "| figure | target | n | measured |", "| --- | --- | --- | --- |"]
    lines += [f"| {text} | {ask} | {len(cases)} | {share([f(c) for c in cases])} |" for text, ask, cases, f in rows]
    cpu = np.median([f["seconds"] for f in found])
    return "\n".join([*lines, f"| CPU time of the diagnosis of two logs, s: median | – | {len(found)} | {cpu:.1f} |"])


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark; return 0 when it is complete."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=40, metavar="N")
    parser.add_argument("--seed", type=int, default=418, help="seed of the cases")
    parser.add_argument("--out", type=Path, default=Path("results/changed_logs"), metavar="DIR")
    parser.add_argument("--minutes", type=float, default=math.inf, metavar="M", help="begin no further case after this")
    parser.add_argument("--report", action="store_true", help="print what is there already, run nothing")
    args = parser.parse_args(argv)
    folder, began = args.out / f"seed-{args.seed}", time.monotonic()
    listed = specs(args.cases, args.seed)
    missing = [s for s in listed if not args.report and not (folder / f"{s.name}.json").is_file()]
    for k in range(0, len(missing), GROUP):
        if time.monotonic() - began < 60.0 * args.minutes:
            for result in examine(missing[k : k + GROUP]):
                write_json(folder / f"{result['name']}.json", result)
    found = [
        json.loads((folder / f"{s.name}.json").read_text()) for s in listed if (folder / f"{s.name}.json").is_file()
    ]
    if not found:
        print(f"There are no results in {folder}.", file=sys.stderr)
        return 1
    print(report(found, f"python benchmarks/changed_logs.py --cases {len(found)} --seed {args.seed}"))
    return 0 if len(found) == len(listed) else 1


if __name__ == "__main__":
    raise SystemExit(main())

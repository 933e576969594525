"""How often a diagnosis is right on benches without load cells, without flow meters, or without both.

Cases are those of the withheld check with one effect that is stronger than the noise; each is diagnosed with all
sensors and with some columns dropped. An effect counts as decidable where all sensors name it and the poor log is not
said to hide it (``cannot_show``).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

from withheld import judge
from withheld.generator import Case, generate
from withheld.suites import BATCH, LAYOUTS, specs

BENCHES = {"no load cells": ("F1", "F2"), "no flow meters": ("mdot1", "mdot2"),
           "neither": ("F1", "F2", "mdot1", "mdot2")}  # fmt: skip
"""The columns that a bench lacks."""


def loud(count: int, seed: int) -> list[Any]:
    """Return the cases of one effect that is at least as strong as the noise."""
    found = [s for s in specs("single", 2 * count + 40, seed) if max(s.targets.values()) >= 1.0]
    return found[:count]


def named(found: Any) -> list[tuple[str, ...]]:
    """Return the classes that a diagnosis names."""
    return [tuple(cause.effects) for cause in found.causes]


def examine(case: Case, drop: Sequence[str]) -> dict[str, Any]:
    """Diagnose a case with all sensors and without some."""
    from pamid.gap import diagnose

    params, (true,) = judge.simulator(case.sim_toml), tuple(case.spec.targets)
    rich = diagnose(case.log, params, seed=case.spec.index)
    begun = time.process_time()
    poor = diagnose(case.log.drop(columns=list(drop)), params, seed=case.spec.index)
    seconds = time.process_time() - begun
    hidden = true in poor.cannot_show
    decided = any(true in c for c in named(rich)) and not hidden
    right = len(named(poor)) == 1 and true in named(poor)[0]
    return {"true": true, "hidden": hidden, "decidable": decided, "right": right, "verdict": poor.verdict,
            "named": named(poor), "rich": named(rich), "class": len(named(poor)[0]) if right else 0,
            "seconds": seconds}  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=60, help="cases, the benches in turn (default: 60)")
    parser.add_argument("--seed", type=int, default=15, help="seed of the cases (default: 15)")
    args = parser.parse_args()
    chosen = loud(args.cases, args.seed)
    done: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for k in range(0, len(chosen), BATCH):
        for j, case in enumerate(generate(chosen[k : k + BATCH], LAYOUTS[k // BATCH % len(LAYOUTS)]), start=k):
            bench = list(BENCHES)[j % len(BENCHES)]
            result = examine(case, BENCHES[bench])
            done[bench].append(result)
            kind = "decidable" if result["decidable"] else "hidden" if result["hidden"] else "undecided"
            said = f"{'right' if result['right'] else result['verdict']:8s} {result['named']}"
            print(f"{bench:15s} {result['true']:22s} {kind:10s} {said}  all sensors: {result['rich']}", flush=True)
    report(done)
    return 0


def report(done: dict[str, list[dict[str, Any]]]) -> None:
    """Print the table."""
    print("\n| bench | cases | decidable | right of these | none of these | hidden | yet named | class size | CPU s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    everything = [r for results in done.values() for r in results]
    for bench, results in [*done.items(), ("all", everything)]:
        sure, hidden = [r for r in results if r["decidable"]], [r for r in results if r["hidden"]]
        right = [r for r in sure if r["right"]]
        share = 100.0 * len(right) / max(len(sure), 1)
        size = sum(r["class"] for r in right) / max(len(right), 1)
        seconds = sorted(r["seconds"] for r in results)[len(results) // 2]
        print(
            f"| {bench} | {len(results)} | {len(sure)} | {len(right)} ({share:.0f} %) | "
            f"{sum(r['verdict'] == 'none' for r in sure)} | {len(hidden)} | {sum(bool(r['named']) for r in hidden)} | "
            f"{size:.2f} | {seconds:.1f} |"
        )


if __name__ == "__main__":
    sys.exit(main())

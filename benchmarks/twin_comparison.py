"""Held-out error of all models on the bench with hysteresis and stretching threads, in force and in flow."""

from __future__ import annotations

import argparse
import sys

import pandas as pd

from pamid.bench import BenchParameters, dataset, unfold
from pamid.compare import compare

EFFECTS = ("hysteresis", "thread_extensibility")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--muscle", choices=("A", "B", "C"), default="B", help="muscle of the study (default: B)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the twin, the folds and the fits (default: 0)")
    parser.add_argument("--folds", type=int, default=4, help="folds of whole runs (default: 4)")
    args = parser.parse_args()
    bench = BenchParameters.for_muscle(args.muscle)
    log = pd.concat(
        [
            dataset(f"D_{args.muscle}", args.seed, effects=EFFECTS),
            dataset("D_tri", args.seed + 1, effects=EFFECTS, muscle=args.muscle),
        ],
        ignore_index=True,
    )
    # The two muscles are identical; the study trains on the upper one.
    table = unfold(log, bench)
    table = table[table["muscle"] == 1].reset_index(drop=True)
    for equation in ("force", "flow"):
        result = compare(table, equation, cv=args.folds, parameters=bench.values(), random_state=args.seed)
        print(
            f"{equation}, sines and triangles of muscle {args.muscle}, effects {' + '.join(EFFECTS)}\n{result}\n",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Withheld cases on any simulator: a servo in MuJoCo, two tanks as FMU, a cylinder and a cart as functions; rivals.

Run with ``python benchmarks/any_simulator``. The systems, their causes and the keys are in code of their own. A stopped
run goes on where it was, ``--report`` only prints what is there.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[2])

from benchmarks.any_simulator import generator, report, runner


def main(argv: list[str] | None = None) -> int:
    """Run the check; return 0 when it is complete."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=20_261_122, help="seed of the check")
    parser.add_argument("--cases", type=int, metavar="N", help="the first N cases of the mixture")
    parser.add_argument("--plant", action="append", help="only this system; may be repeated")
    parser.add_argument("--suite", choices=generator.COUNTS, action="append", help="only this suite; may be repeated")
    parser.add_argument(
        "--out", type=Path, default=Path("results/any_simulator"), metavar="DIR", help="where results go"
    )
    parser.add_argument("--no-rivals", action="store_true", help="pamid alone")
    parser.add_argument("--report", action="store_true", help="print what is there, run nothing")
    args = parser.parse_args(argv)
    specs = generator.specs(args.seed)
    specs = [s for s in specs if not args.plant or s.plant in args.plant]
    specs = [s for s in specs if not args.suite or s.suite in args.suite][: args.cases]
    folder = args.out / f"seed-{args.seed}"
    if not args.report:
        runner.run(specs, folder, not args.no_rivals)
    records = report.load(folder, [s.name for s in specs])
    print(f"\n{len(records)} of {len(specs)} cases\n\n{report.table(records)}\n\n{report.wrong(records)}")
    return 0 if len(records) == len(specs) else 1


if __name__ == "__main__":
    raise SystemExit(main())

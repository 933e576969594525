"""Own simulators: right, with one cause, effects that commute, libraries cut and doubled, more sensors, practice logs.

Every case runs in a process of its own with a time limit, prints as it ends and may be kept as a JSON line, so that two
revisions of the library can be compared case by case with ``--compare``.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from benchmarks._answers import compared, each, keep, kept, times_of
from benchmarks._own import coloured, commute, named, practice, right, sensors, shorter, stepped, varied

SUITES = {
    "coloured": coloured,
    "commute": commute,
    "library": shorter,
    "sensors": sensors,
    "right": right,
    "stepped": stepped,
    "named": named,
    "practice": practice,
    "varied": varied,
}
CASES = {
    "coloured": 20,
    "commute": 9,
    "library": 5,
    "sensors": 8,
    "right": 10,
    "named": 10,
    "practice": 6,
    "varied": 18,
}
"""Cases of a quick run."""


def main(argv: list[str] | None = None) -> int:
    """Run the suites; return 0 when each case has an answer."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--suite", choices=SUITES, action="append", help="only this suite; may be repeated")
    parser.add_argument("--cases", type=int, metavar="N", help="cases of a suite (default: a quick run)")
    parser.add_argument("--only", metavar="TEXT", help="only cases whose name holds this")
    parser.add_argument("--seed", type=int, default=20_261_123, help="seed of the cases")
    parser.add_argument("--practice", type=Path, metavar="FOLDER", help="folder of the practice logs of users' own")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes side by side")
    parser.add_argument("--limit", type=float, default=300.0, metavar="S", help="seconds for one case")
    parser.add_argument("--out", type=Path, metavar="FILE", help="keep the cases there, as JSON lines; go on from them")
    parser.add_argument(
        "--compare", type=Path, nargs=2, metavar=("A", "B"), help="print where two such files differ, run nothing"
    )
    args = parser.parse_args(argv)
    if args.compare:
        print("\n".join(compared(*args.compare)))
        return 0
    practice.FOLDER[:] = [args.practice] if args.practice else []
    done = kept(args.out) if args.out and args.out.is_file() else {}
    missing = 0
    for name in args.suite or SUITES:
        suite, begun, records = SUITES[name], time.perf_counter(), []
        jobs = suite.jobs(args.cases or CASES[name], args.seed)
        jobs = [(case, job) for case, job in jobs if not args.only or args.only in case]
        records = [done[case] for case, _ in jobs if case in done]
        print(f"\n{name}: {len(jobs)} cases", flush=True)
        for case, record in each([j for j in jobs if j[0] not in done], args.limit, args.workers):
            keep(args.out, case, record)
            records.append(record)
            print(f"  {case}, {times_of(record)}: {record.get('error') or suite.line(record)}", flush=True)
        missing += sum("error" in r for r in records)
        print("\n".join(f"{name}: {text}" for text in suite.summary(records)))
        print(f"{name}: {time.perf_counter() - begun:.0f} s, {sum('error' in r for r in records)} without an answer")
    return int(missing > 0)


if __name__ == "__main__":
    raise SystemExit(main())

"""The withheld check: which of the causes hidden from the diagnosis are named, and how much of the gap they close.

Run with ``python benchmarks/withheld``; ``--short`` takes minutes, the whole of it hours. A stopped run goes on where
it was, ``--report`` only prints what is there. Logs come from benches of other code than the library's, and rivals run
on the same ones.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # processes run side by side
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # not this folder, whose modules are a package's

from benchmarks.withheld import metrics, novelty, report, runner, several, suites, trust

TRUSTED = Path(__file__).resolve().parents[2] / "pamid/gap/diagnosis/trusted.py"


def main(argv: list[str] | None = None) -> int:
    """Run the check; return 0 when it is complete."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--short", action="store_true", help="about forty cases")
    parser.add_argument("--cases", type=int, metavar="N", help="about N cases, in the proportions of the whole")
    parser.add_argument("--suite", choices=suites.SUITES, action="append", help="only this suite; may be repeated")
    parser.add_argument(
        "--seed", type=int, default=20_261_121, help="seed of the check; every case has its own below it"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/withheld"), metavar="DIR", help="where results go")
    parser.add_argument("--no-rivals", action="store_true", help="pamid only")
    parser.add_argument("--only-rivals", action="store_true", help="the rivals alone")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="write logs, simulators and keys there, too")
    parser.add_argument("--report", action="store_true", help="print what is there already, run nothing")
    parser.add_argument(
        "--pool",
        type=int,
        action="append",
        default=[],
        metavar="SEED",
        help="count that run's cases, too, also to fit trust",
    )
    parser.add_argument(
        "--develop", action="store_true", help="name causes however little is to be trusted, and fit what trust is"
    )
    parser.add_argument(
        "--learn", action="store_true", help="take signatures alone, for the rivals of the open set to learn from"
    )
    parser.add_argument("--few-runs", action="store_true", help="logs of one to three runs, 1,500 to 4,500 rows")
    parser.add_argument("--write", action="store_true", help="with --develop: write what was fitted into the library")
    args = parser.parse_args(argv)

    whole = suites.LEARN if args.learn else suites.DEVELOP if args.develop else suites.COUNTS
    counts = dict(suites.SHORT if args.short else whole)
    if args.cases:
        counts = {s: max(1, round(args.cases * n / sum(whole.values()))) for s, n in whole.items()}
    if args.suite:
        counts = {s: n for s, n in counts.items() if s in args.suite}
        if "several" in args.suite:
            counts["several"] = args.cases or several.COUNT
    listed = suites.batches(counts, args.seed, suites.FEW_RUNS if args.few_runs else suites.LAYOUTS)
    folder = args.out / f"{'learn' if args.learn else 'develop' if args.develop else 'seed'}-{args.seed}"
    rivals = not (args.no_rivals or args.develop or args.learn)
    diagnose = runner.named_always if args.develop else runner.ours
    if not args.report:
        runner.run(listed, folder / "cases", args.jobs, rivals, args.only_rivals or args.learn, args.keep, diagnose)
    names = sorted(s.name for b in listed for s in b.specs)
    there = [n for n in names if (folder / "cases" / f"{n}.json").is_file()]
    if not there:
        print(f"There are no results in {folder}.", file=sys.stderr)
        return 1
    results = runner.load(folder / "cases", there)
    for seed in args.pool:
        results += [{**r, "name": f"{r['name']}@{seed}"} for r in _written(args.out / f"seed-{seed}" / "cases")]
    if args.learn:
        print(f"{len(there)} of {len(names)} signatures.")
        return 0 if len(there) == len(names) else 1
    if args.develop:
        runs = [_written(f) for f in sorted(args.out.glob("develop-*/cases"))]
        runs += [_written(args.out / f"seed-{seed}" / "cases") for seed in args.pool]
        every = [{**r, "name": f"{r['name']}@{k}"} for k, run in enumerate(runs) for r in run]
        print(trust.report(every, TRUSTED if args.write else None))
        return 0 if len(there) == len(names) else 1
    learned = [r for kind in ("learn", "develop") for f in args.out.glob(f"{kind}-*/cases") for r in _written(f)]
    taught = novelty.known(learned)
    if not taught:
        print("The rivals of the open set are left out: run with --learn first, they learn from it.", file=sys.stderr)
    for name, answers in novelty.judged(taught, results).items() if taught else ():
        next(r for r in results if r["name"] == name)["answers"].update(answers)
    trust.draw(results, folder / "risk-coverage.png")
    text = report.report(results, f"python benchmarks/withheld --seed {args.seed}")
    (folder / "report.md").write_text(text, encoding="utf-8")
    measured = {k: {n: asdict(f) for n, f in v.items()} for k, v in report.figures(results).items()}
    runner.write_json(folder / "figures.json", measured)
    for method in runner.METHODS:
        if found := runner.records(results, method):
            stem = method.replace(" ", "-")
            (folder / f"confusion-{stem}.csv").write_text(report.matrix(metrics.confusion(found)), encoding="utf-8")
            (folder / f"inversion-{stem}.csv").write_text(report.matrix(metrics.inversion(found)), encoding="utf-8")
    print(text)
    if len(there) < len(names):
        print(f"{len(names) - len(there)} of {len(names)} cases have no result yet.", file=sys.stderr)
    return 0 if len(there) == len(names) else 1


def _written(folder: Path) -> list[dict[str, Any]]:
    return runner.load(folder, sorted(path.stem for path in folder.glob("*.json")))


if __name__ == "__main__":
    raise SystemExit(main())

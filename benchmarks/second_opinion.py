"""Second opinion on other fits: how often a parameter that absorbed a missing cause is found, and a right one accused.

Four simulators (MuJoCo, two functions, an FMU) are fitted by least squares without bounds to logs of systems that have
a cause the simulator lacks, or none. A fit absorbed its cause where a number is further from the truth than ten times
what fits of clean logs are (their root mean square) and than 2 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.any_simulator.causes import Number
from benchmarks.any_simulator.generator import Case, Spec, make, sizes_of
from benchmarks.any_simulator.nominal import PORTS, simulator_of
from benchmarks.any_simulator.plants import PLANTS
from benchmarks.any_simulator.simulate import record
from pamid.gap.simulated import evidence_of
from pamid.opinion import second_opinion
from pamid.simulators import Simulator

FAR, LEAST = 10.0, 0.02
SEED = 20261124


def truth(case: Case) -> dict[str, float]:
    """Return the numbers that the system had, by the simulator's names: the draw of `make` once more."""
    spec, plant = case.spec, case.plant
    suites = ["none", "single", "foreign"]
    rng = np.random.default_rng([spec.seed, suites.index(spec.suite), list(PLANTS).index(spec.plant), spec.number])
    sizes_of(plant, record(plant, [], {}, rng, 2))
    own = PORTS.get(spec.plant, {})
    return {own.get(n, n): v * (1.0 + float(rng.uniform(-0.7, 0.7)) * tol) for n, (v, tol) in plant.numbers.items()}


def fitted(case: Case, simulator: Simulator) -> dict[str, float]:
    """Return the numbers that least squares without bounds finds."""
    evidence = evidence_of(case.log, simulator)
    names = evidence.free

    def left(x: np.ndarray) -> np.ndarray:
        return np.asarray(evidence.z({}, dict(zip(names, map(float, x), strict=True))))

    x = least_squares(left, np.zeros(len(names)), diff_step=0.02, x_scale=1.0, max_nfev=30).x
    found = dict(zip(names, map(float, x), strict=True))
    return {n: simulator.get(n) * (1.0 + tol * found[n]) for n, tol in simulator.tolerance.items() if n in found}


def solve(spec: Spec) -> dict[str, Any]:
    """Return what is true of a case, what was fitted, and the opinion."""
    case = make(spec)
    with tempfile.TemporaryDirectory() as folder:
        simulator = simulator_of(case.plant, Path(folder))
        fit = fitted(case, simulator)
        begun = time.perf_counter()
        said = second_opinion(case.log, simulator, fit)
    return {
        "name": spec.name, "plant": spec.plant, "cause": case.cause.name if case.cause else "none",
        "number": isinstance(case.cause, Number), "truth": truth(case), "fit": fit, "absorbed": said.absorbed,
        "missing": said.missing, "verdict": said.diagnosis.verdict, "seconds": time.perf_counter() - begun,
        "numbers": [vars(j) | {"ci90": list(j.ci90)} for j in said.numbers],
    }  # fmt: skip


def errors_of(r: dict[str, Any]) -> dict[str, float]:
    """Return by how much each fitted number is off, relative."""
    return {n: abs(v / r["truth"][n] - 1.0) for n, v in r["fit"].items() if n in r["truth"]}


def report(results: list[dict[str, Any]]) -> None:
    """Print the table."""
    clean = [r for r in results if r["cause"] == "none"]
    usual: dict[tuple[str, str], list[float]] = {}
    for r in clean:
        for n, e in errors_of(r).items():
            usual.setdefault((r["plant"], n), []).append(e)
    limit = {k: max(LEAST, FAR * float(np.sqrt(np.mean(np.square(v))))) for k, v in usual.items()}
    told, all_ = 0, 0
    for r in (r for r in results if r["cause"] != "none" and not r["number"]):
        took = [n for n, e in errors_of(r).items() if e > limit.get((r["plant"], n), LEAST)]
        if took:
            all_ += 1
            told += bool(set(took) & set(r["absorbed"]))
            if not set(took) & set(r["absorbed"]):
                print(f"  not told: {r['name']} {r['cause']}: {', '.join(took)} ({r['verdict']})")
    accused = [r["name"] for r in clean if r["absorbed"]]
    causes = len({r["cause"] for r in results if r["cause"] != "none" and not r["number"]})
    print(f"{causes} causes on {len({r['plant'] for r in results})} simulators, {len(results)} fits")
    print(f"absorbed a cause: {all_}, told {told} ({told / max(all_, 1):.0%}; target 90 %)")
    print(
        f"clean: {len(clean)}, accused {len(accused)} ({len(accused) / max(len(clean), 1):.0%}; target 2 %) {accused}"
    )
    print(f"median {np.median([r['seconds'] for r in results]):.0f} s a fit")


def main() -> None:
    """Run the cases that have no result yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/second_opinion.jsonl"))
    parser.add_argument("--clean", type=int, default=13, metavar="N", help="clean logs of each simulator")
    parser.add_argument("--causes", type=int, default=12, metavar="N", help="logs with a cause of each simulator")
    parser.add_argument("--plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--report", action="store_true", help="only print the table")
    args = parser.parse_args()
    done = [json.loads(line) for line in args.out.read_text().splitlines()] if args.out.is_file() else []
    known = {r["name"] for r in done}
    wanted = [Spec(s, p, k, args.seed) for k in range(max(args.clean, args.causes)) for p in args.plants
              for s, n in (("single", args.causes), ("none", args.clean)) if k < n]  # fmt: skip
    args.out.parent.mkdir(parents=True, exist_ok=True)
    for spec in [] if args.report else wanted:
        if spec.name in known:
            continue
        r = solve(spec)
        done.append(r)
        with args.out.open("a") as file:
            file.write(json.dumps(r, default=float) + "\n")
        off = ", ".join(f"{n} {100 * e:.1f} %" for n, e in errors_of(r).items())
        print(f"{r['name']}: {r['cause']} -> {r['verdict']} {r['missing']}, fit off {off}; absorbed {r['absorbed']}, "
              f"{r['seconds']:.0f} s", flush=True)  # fmt: skip
    report(done)


if __name__ == "__main__":
    main()

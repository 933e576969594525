"""Time and memory of a whole diagnosis with its report, over the whole library, against the rows of the log.

Every log and size runs in a process of its own: a log without a gap, with one cause and with two. Processor time is
that of one core; memory is the peak of the process, read from Linux's ``/proc``. Run with
``python benchmarks/diagnosis_time.py``; ``--full`` adds ten million rows, ``--against DIR`` takes turns with another
checkout of pamid on 80,000 rows.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the figures are for one core
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

ROWS = (10_000, 20_000, 40_000, 80_000)
FULL = 10_000_000
CAUSES = {
    "no gap": [],
    "one cause": [("coulomb_friction", {"amplitude": 4.0})],
    "two causes": [("viscous_friction", {"coefficient": 60.0}), ("dead_volume", {"volume": 1e-5})],
}
TOLERANCE = {"rest_diameter": 0.005, "braid_angle": 0.005, "sonic_conductance": 0.02, "inertia": 0.02}


def log_of(rows: int, causes: str) -> pd.DataFrame:
    """Simulate runs of 2,000 rows, repeated under new names beyond eighty thousand."""
    from pamid.bench import BenchParameters, simulate, sine, step, triangle

    kinds = [(sine, 2.0, 15.0), (sine, 5.0, 10.0), (sine, 8.0, 20.0), (step, 0.0, 15.0), (triangle, 3.0, 12.0)]
    n = min(rows, ROWS[-1]) // 2000
    runs = [f(a, b * (1 + 0.01 * (k // 5)), 2000) for k in range(n) for f, a, b in [kinds[k % 5]]]
    actual = BenchParameters.for_muscle("B").replace(effects=CAUSES[causes])
    log = simulate(actual, runs, seed=0)
    log["trajectory"] = [f"{name}-{k}" for name, k in zip(log["trajectory"], np.arange(len(log)) // 2000, strict=True)]
    copies = -(-rows // len(log))
    if copies == 1:
        return log
    columns = {c: np.tile(log[c].to_numpy(), copies)[:rows] for c in log.columns if c != "trajectory"}
    names, code = np.unique(log["trajectory"].to_numpy(dtype=str), return_inverse=True)
    codes = np.concatenate([code + k * len(names) for k in range(copies)])[:rows]
    categories = [f"{name}-{k}" for k in range(copies) for name in names]
    return pd.DataFrame({"trajectory": pd.Categorical.from_codes(codes, categories), **columns})


def one(rows: int, causes: str) -> dict[str, object]:
    """Diagnose one log and write its report; return what it took."""
    from pamid.bench import BenchParameters
    from pamid.gap import diagnose
    from pamid.report import write_report

    log = log_of(rows, causes)
    nominal = BenchParameters.for_muscle("B").replace(tolerance=TOLERANCE)
    began, cpu = time.perf_counter(), time.process_time()
    d = diagnose(log, nominal)
    with tempfile.TemporaryDirectory() as folder:
        write_report(d, Path(folder) / "report.html")
    spent, busy = time.perf_counter() - began, time.process_time() - cpu
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    peak = next((float(line.split()[1]) / 1e6 for line in lines if line.startswith("VmHWM")), float("nan"))
    named = " + ".join("/".join(c.effects) for c in d.causes) or d.verdict
    return {"rows": len(log), "seconds": spent, "cpu": busy, "peak": peak, "named": named}


def apart(rows: int, causes: str, checkout: str | None = None) -> dict[str, Any]:
    """Return what `one` does, in a process of its own, of this pamid or of another checkout's."""
    command = [sys.executable, __file__, "--one", str(rows), causes]
    environment = os.environ if checkout is None else {**os.environ, "PYTHONPATH": str(Path(checkout).resolve())}
    ran = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return dict(json.loads(ran.stdout))


def compare(checkout: str) -> None:
    """Print the processor time of this pamid and another, each log one after the other, thrice; medians."""
    print("| log | other, processor time (s) | this (s) | ratio | other named | this named |")
    print("| --- | --- | --- | --- | --- | --- |")
    for causes in CAUSES:
        found = [[apart(ROWS[-1], causes, where) for where in (checkout, None)] for _ in range(3)]
        other, this = (float(np.median([pair[k]["cpu"] for pair in found])) for k in (0, 1))
        names = " | ".join(str(found[0][k]["named"]) for k in (0, 1))
        print(f"| {causes} | {other:.1f} | {this:.1f} | {this / other:.2f} | {names} |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--full", action="store_true", help="ten million rows as well")
    parser.add_argument("--against", metavar="DIR", help="another checkout to take turns with, on 80,000 rows")
    parser.add_argument("--one", nargs=2, metavar=("ROWS", "LOG"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(one(int(args.one[0]), args.one[1])))
        return
    if args.against:
        compare(args.against)
        return
    print("| log | rows | time (s) | processor time (s) | peak memory (GB) | named |")
    print("| --- | --- | --- | --- | --- | --- |")
    for causes in CAUSES:
        for rows in (*ROWS, FULL) if args.full and causes == "one cause" else ROWS:
            r = apart(rows, causes)
            print(
                f"| {causes} | {r['rows']:,} | {r['seconds']:.1f} | {r['cpu']:.1f} | {r['peak']:.2f} | {r['named']} |",
                flush=True,
            )


if __name__ == "__main__":
    main()

"""Time and memory of evaluating logs and of predicting, from ten thousand rows to ten million.

Every size runs in a process of its own. ``data`` is the memory of what goes in and comes out, ``on top`` the peak of
what the work needs beside it. ``growth`` compares times with the size before: a power of one is linear. Memory is read
from Linux's ``/proc``. Run with ``python benchmarks/scaling.py``; ``--full`` goes on to ten million rows.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the figures are for one core

import numpy as np
import pandas as pd

ROWS = (10_000, 100_000, 1_000_000)
TILED = 2000
"""Rows of one run of the twin; longer logs hold many such runs."""
MB = 1e6


def memory(what: str) -> float:
    """Return resident memory, ``"VmRSS"``, or its peak, ``"VmHWM"``, MB."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return float("nan")
    return next(float(line.split()[1]) for line in lines if line.startswith(what)) * 1024 / MB


def measure(work: Callable[[], object]) -> tuple[float, float]:
    """Return the time of a call, s, and by how much its peak exceeds the memory before it, MB."""
    reset = Path("/proc/self/clear_refs")
    if reset.exists():
        reset.write_text("5")  # the peak so far is forgotten
    before, start = memory("VmRSS"), time.perf_counter()
    work()
    return time.perf_counter() - start, memory("VmHWM") - before


def log_of(rows: int) -> pd.DataFrame:
    """Repeat one simulated run under new names until there are enough rows."""
    from pamid.bench import BenchParameters, simulate, sine

    one = simulate(BenchParameters.for_muscle("B"), [sine(4, 15, TILED)], seed=0)
    n = -(-rows // len(one))
    # A view of one table cannot be repeated, so columns are built one at a time, names as categories.
    columns = {
        name: np.tile(one[name].to_numpy(), n)[:rows]
        for name in one.columns
        if pd.api.types.is_numeric_dtype(one[name])
    }
    columns["trajectory"] = pd.Categorical.from_codes(
        np.repeat(np.arange(n), len(one))[:rows], [f"sine-{k}" for k in range(n)]
    )
    return pd.DataFrame(columns, copy=False)


def evaluation(rows: int) -> dict[str, float]:
    """Evaluate all equations of the bench on a log."""
    from pamid.bench import BenchParameters
    from pamid.equations import evaluate_log

    bench = BenchParameters.for_muscle("B")
    evaluate_log(log_of(4 * TILED), bench)  # imports and first calls are not counted
    log = log_of(rows)
    seconds, top = measure(lambda: evaluate_log(log, bench))
    return {"seconds": seconds, "data": log.memory_usage().sum() / MB, "top": top}


def prediction(rows: int) -> dict[str, float]:
    """Predict force with a fitted hybrid model of the default size."""
    from pamid.estimators import StaticPIHM

    rng = np.random.default_rng(0)

    def signals(n: int) -> np.ndarray:
        X = rng.random((n, 4))
        X *= [0.2, 1.0, 4e5, 1e6]
        X += [0.0, -0.5, 2e5, -5e5]
        return X

    X = signals(500)
    model = StaticPIHM(max_iter=5, random_state=0).fit(X, (X[:, 2] - 101_325) * 8e-4 * (1 - 3.3 * X[:, 0]))
    model.predict(signals(200_000))  # first calls are not counted
    X = signals(rows)
    seconds, top = measure(lambda: model.predict(X))
    out = 8 * rows / MB
    return {"seconds": seconds, "data": X.nbytes / MB + out, "top": top - out}


WORK = {"evaluate_log": evaluation, "StaticPIHM.predict": prediction}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", action="store_true", help="go on to ten million rows")
    parser.add_argument("--one", nargs=2, metavar=("WORK", "ROWS"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps({k: float(v) for k, v in WORK[args.one[0]](int(args.one[1])).items()}))
        return 0
    print("work                      rows        s  us / row  growth  data / MB  on top / MB  bytes / row")
    for work in WORK:
        last: tuple[int, float] | None = None
        for rows in (*ROWS, 10_000_000) if args.full else ROWS:
            # A fresh process: the peak of one size is not that of a larger one before it.
            command = [sys.executable, __file__, "--one", work, str(rows)]
            out = json.loads(
                subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1]
            )
            growth = np.log(out["seconds"] / last[1]) / np.log(rows / last[0]) if last else np.nan
            print(
                f"{work:18s} {rows:11,d} {out['seconds']:8.2f} {1e6 * out['seconds'] / rows:9.2f} {growth:7.2f} "
                f"{out['data']:10.0f} {out['top']:12.0f} {1e6 * out['top'] / rows:12.0f}",
                flush=True,
            )
            last = rows, out["seconds"]
    return 0


if __name__ == "__main__":
    sys.exit(main())

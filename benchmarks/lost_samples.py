"""The answer of a diagnosis on logs with 20 % of their samples lost, against the answer on the whole ones.

Run with ``python benchmarks/lost_samples.py`` on logs of the twin, or with folders that hold ``data.parquet`` and
``sim.toml`` each. Every log is diagnosed whole and with samples lost at random; one line a log says what came out.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the figures are for one core
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

from pamid.bench import BenchParameters, simulate, sine, step, triangle
from pamid.gap import Diagnosis, diagnose
from pamid.signals import read_log

TOLERANCE = {"rest_diameter": 0.005, "braid_angle": 0.005, "sonic_conductance": 0.02, "inertia": 0.02}
CAUSES = {
    "no gap": [],
    "dry friction": [("coulomb_friction", {"amplitude": 4.0})],
    "leak": [("leakage", {"conductance": 1.5e-10})],
    "two": [("viscous_friction", {"coefficient": 120.0}), ("dead_volume", {"volume": 1e-5})],
}


def logs(folders: list[Path]) -> Iterator[tuple[str, pd.DataFrame, BenchParameters]]:
    """Yield the name of each log, its table and its simulator."""
    for folder in folders:
        yield folder.name, read_log(folder / "data.parquet", nan="keep"), BenchParameters.from_toml(folder / "sim.toml")
    if not folders:
        nominal = BenchParameters.for_muscle("B").replace(tolerance=TOLERANCE)
        runs = [sine(2, 15, 3000), sine(7, 10, 3000), step(0, 15, 3000), triangle(3, 12, 3000)]
        for name, causes in CAUSES.items():
            yield name, simulate(nominal.replace(effects=causes), runs, seed=0), nominal


def lost(log: pd.DataFrame, share: float, seed: int) -> pd.DataFrame:
    """Return a log without a share of its rows, drawn at random."""
    keep = np.random.default_rng(seed).random(len(log)) >= share
    return log[keep].reset_index(drop=True)


def said(d: Diagnosis) -> tuple[str, ...]:
    """Return the answer: the verdict, and the effects of each cause."""
    return (d.verdict, *sorted(" or ".join(sorted(c.effects)) for c in d.causes))


def main() -> None:
    """Print one line a log, and how many answers are the same."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER", help="holds data.parquet and sim.toml")
    parser.add_argument("--share", type=float, default=0.2, help="share of the samples that are lost (default: 0.2)")
    parser.add_argument("--seed", type=int, default=0, help="which samples are lost (default: 0)")
    args = parser.parse_args()
    same = count = 0
    for name, log, params in logs(args.folders):
        started = time.perf_counter()
        whole, damaged = (said(diagnose(table, params)) for table in (log, lost(log, args.share, args.seed)))
        count += 1
        same += whole == damaged
        took = f"{time.perf_counter() - started:.0f} s"
        word = "same" if whole == damaged else "OTHER"
        print(f"{name}: {word}: whole {', '.join(whole)}; lost {', '.join(damaged)} ({took})", flush=True)
    print(f"{same} of {count} logs get the same answer with {args.share:.0%} of their samples lost")


if __name__ == "__main__":
    main()

"""Held-out errors of all kinds of models in force, flow, inverse or free run, on the bench, on lifts or on logs."""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pamid.bench import BenchParameters, dataset, unfold
from pamid.bench.single import LOADS, LiftSettings, simulate_lift
from pamid.compare import compare
from pamid.plots import comparison_plot
from pamid.signals import read_log

FESTO = Path(__file__).resolve().parent.parent / "docs" / "mappings" / "festo.toml"
MODELS = {
    "force": [
        "StaticPIHM", "ResidualHybrid", "GeometricForce(tondu_lopez)", "StaticForceMap", "NonlinearElastic",
        "HosovskyHybrid", "ThreeElement", "PolynomialForce(surface)", "SINDyRegressor", "MLP", "Recurrent",
    ],
    "flow": [
        "ThermodynamicPIHM", "GeometricFlow(tondu_lopez)", "GeometricFlow(chou_hannaford)", "PolynomialFlow",
        "SINDyRegressor", "MLP",
    ],
    "inverse": ["InverseModel*", "InvertedForce*"],
    "dynamic": ["NNARX*", "PolynomialNARX*", "ForwardModel*", "MLP", "Recurrent"],
}  # fmt: skip
CUTS = {20: 0.182, 30: 0.281, 40: 0.382}
"""Festo muscles of 10 mm: cut length in cm, and the length at rest between the clamps, m."""
LIFTING = ["LiftedLoad*"]
"""Models of a contraction under a load, beside those of any free run."""


def lifts(seed: int) -> pd.DataFrame:
    """Lift the study's loads at three frequencies; 20 rows a second."""
    runs = []
    for k, frequency in enumerate((0.05, 0.1, 0.2)):
        log = simulate_lift(loads=LOADS, every=50, seed=seed + k, settings=LiftSettings(frequency=frequency))
        runs.append(log.assign(trajectory=log["trajectory"] + f"@{frequency:g}"))
    return pd.concat(runs, ignore_index=True)


def source(data: str, seed: int, cut: int = 30) -> tuple[pd.DataFrame, np.ndarray | None, dict[str, Any]] | None:
    """Return the table, the rows that count and the geometry; None where the folder is not there."""
    if data == "lifts":
        return lifts(seed), None, {"rest_length": 0.2, "rest_diameter": 0.02}
    if data == "twin":
        bench = BenchParameters.for_muscle("B")
        effects = ("hysteresis", "thread_extensibility")
        log = [dataset("D_B", seed, effects=effects), dataset("D_tri", seed + 1, effects=effects, muscle="B")]
        table = unfold(pd.concat(log, ignore_index=True), bench)
        # the two muscles are identical; the study trains on the upper one
        return table[table["muscle"] == 1].reset_index(drop=True), None, bench.values()
    folder = Path(data)
    if (folder / "data.parquet").is_file():
        bench = BenchParameters.from_toml(folder / "sim.toml")
        return unfold(pd.read_parquet(folder / "data.parquet"), bench), None, bench.values()
    if not (files := sorted(folder.glob(f"10mm_{cut}cm_*.mat"))):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        log = read_log(files, FESTO, nan="drop")
    return log, (log["F"] > 5.0).to_numpy(), {"rest_length": CUTS[cut], "rest_diameter": 0.01}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problem", choices=tuple(MODELS), default="force", help="what is predicted (default: force)")
    parser.add_argument(
        "--data", default="twin", help="twin, lifts, a folder with data.parquet and sim.toml, or one with Festo logs"
    )
    parser.add_argument("--cut", type=int, choices=tuple(CUTS), default=30, help="cut of Festo logs, cm (default: 30)")
    parser.add_argument("--estimators", nargs="+", help="other models than those of the problem's list")
    parser.add_argument("--split", choices=("run", "kind"), default="run", help="what a fold leaves out (default: run)")
    parser.add_argument("--folds", type=int, default=4, help="folds of whole runs (default: 4)")
    parser.add_argument("--rows", type=int, default=3000, help="most rows of a fit (default: 3000)")
    parser.add_argument("--score-rows", type=int, default=10_000, help="most rows scored (default: 10000)")
    parser.add_argument("--seed", type=int, default=0, help="seed of twin, folds and fits (default: 0)")
    parser.add_argument("--plot", type=Path, help="file for the plot, .svg or .png")
    args = parser.parse_args()
    found = source(args.data, args.seed, args.cut)
    if found is None:
        print("skipped: --data names no folder with data.parquet and sim.toml, or with Festo logs")
        return 0
    table, rows, geometry = found
    output = "eps" if "load" in table.columns else "P"
    models = MODELS[args.problem] + (LIFTING if args.problem == "dynamic" and output == "eps" else [])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = compare(
            table,
            args.problem,
            args.estimators or models,
            cv=args.folds,
            split=args.split,
            rows=rows,
            fit_rows=args.rows,
            score_rows=args.score_rows,
            parameters=geometry,
            tuning=2.0 if rows is not None else "auto",
            random_state=args.seed,
            output=output,
        )
    where = args.data if args.data in ("twin", "lifts") else "log"
    print(f"{args.problem}, {where}, folds that leave out a {args.split}\n{result}")
    if args.plot is not None:
        comparison_plot(result, args.plot, title=f"{args.problem}, {where}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

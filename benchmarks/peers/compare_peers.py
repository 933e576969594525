"""Held-out error and fit time of pamid, SysIdentPy and jax-sysid (in their own environment) on the same folds."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone
from sklearn.utils.validation import has_fit_parameter

from pamid.compare.entries import CandidateModel, candidates
from pamid.compare.protocol import Prepared, folds, prepare

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from choosing import CUTS, LIFTING, source  # noqa: E402

OURS = {
    "force": ["StaticPIHM", "ResidualHybrid", "GeometricForce(tondu_lopez)", "MLP", "SINDyRegressor"],
    "dynamic": ["NNARX", "PolynomialNARX", "ForwardModel(direction)", "MLP"],
}


def ours(entry: CandidateModel, ready: Prepared, splits: list[Any]) -> tuple[np.ndarray, float]:
    """Fit one of ours in every fold; return its predictions and the processor seconds of a fit."""
    found, seconds = [], 0.0
    for fold in splits:
        fit, test = (fold.even_train, fold.even_test) if entry.sequential else (fold.fit_rows, fold.score_rows)
        X, Y = ready.table[list(entry.columns)], ready.table[list(entry.targets)].to_numpy(dtype=float)
        y = Y[:, 0] if Y.shape[1] == 1 else Y
        model = clone(entry.estimator)
        started = time.process_time()
        more = {"groups": ready.runs[fit]} if has_fit_parameter(model, "groups") else {}
        if not ready.usable[fit].all() and has_fit_parameter(model, "sample_weight"):
            more["sample_weight"] = ready.usable[fit].astype(float)
        model.fit(X.iloc[fit], y[fit], **more)
        seconds += time.process_time() - started
        z = np.asarray(model.predict(X.iloc[test]), dtype=float)
        z = z[:, entry.targets.index(ready.target)] if z.ndim == 2 else z
        found.append(z[np.searchsorted(test, fold.score_rows)] if entry.sequential else z)
    return np.concatenate(found), seconds / len(splits)


def peers(args: argparse.Namespace, ready: Prepared, splits: list[Any], columns: list[str]) -> dict[str, Any]:
    """Hand the folds to the peers' environment and read what they answer."""
    dynamic = args.problem == "dynamic"
    codes = pd.factorize(ready.table["trajectory"])[0]
    table, y = ready.table[columns].to_numpy(dtype=float), ready.table[ready.target].to_numpy(dtype=float)
    arrays: dict[str, Any] = {"folds": len(splits), "dynamic": dynamic}
    for k, fold in enumerate(splits):
        fit, test = (fold.even_train, fold.even_test) if dynamic else (fold.fit_rows, fold.score_rows)
        arrays |= {f"X{k}": table[fit], f"y{k}": y[fit], f"run{k}": codes[fit]}
        # a free run starts from the first value of its run; nothing else of the test is handed over
        start = ready.table["initial"].to_numpy()[test] if dynamic else np.zeros(len(test))
        arrays |= {f"Xt{k}": table[test], f"yt{k}": start, f"runt{k}": codes[test]}
    with tempfile.TemporaryDirectory() as folder:
        given, answer = Path(folder) / "folds.npz", Path(folder) / "answer.npz"
        np.savez(given, **arrays)
        subprocess.run([str(python(args.env)), str(HERE / "fit_peers.py"), str(given), str(answer)], check=True)
        with np.load(answer, allow_pickle=False) as found:
            return {name: found[name] for name in found.files}


def python(env: Path) -> Path:
    """Return the Python of the peers' environment, made if it is not there."""
    path = env / "bin" / "python"
    if not path.exists():
        subprocess.run([sys.executable, "-m", "venv", str(env)], check=True)
        subprocess.run([str(path), "-m", "pip", "install", "-q", "-r", str(HERE / "requirements.txt")], check=True)
    return path


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--env",
        type=Path,
        default=Path("peers"),
        help="folder of the peers' environment; made if missing (default: peers)",
    )
    parser.add_argument("--problem", choices=tuple(OURS), default="force", help="what is predicted (default: force)")
    parser.add_argument(
        "--data", default="twin", help="twin, lifts, or a folder with data.parquet and sim.toml, or with Festo logs"
    )
    parser.add_argument("--estimators", nargs="+", help="others of ours than those of the problem's list")
    parser.add_argument("--alone", action="store_true", help="ours only, without the peers")
    parser.add_argument("--cut", type=int, choices=tuple(CUTS), default=30, help="cut of Festo logs, cm (default: 30)")
    parser.add_argument("--folds", type=int, default=4, help="folds of whole runs (default: 4)")
    parser.add_argument("--split", choices=("run", "kind"), default="run", help="what a fold leaves out (default: run)")
    parser.add_argument("--rows", type=int, default=3000, help="most rows of a fit (default: 3000)")
    parser.add_argument("--seed", type=int, default=0, help="seed (default: 0)")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    opened = source(args.data, args.seed, args.cut)
    if opened is None:
        print("skipped: --data names no folder with data.parquet and sim.toml, or with Festo logs")
        return 0
    table, rows, geometry = opened
    output = "eps" if "load" in table.columns else "P"
    ready = prepare(
        table, args.problem, rows=rows, score_rows=10_000, output=output, tuning=2.0 if rows is not None else "auto"
    )
    splits = list(folds(ready, args.folds, split=args.split, fit_rows=args.rows, random_state=args.seed))
    scored = np.concatenate([fold.score_rows for fold in splits])
    target = ready.table[ready.target].to_numpy(dtype=float)
    y, dynamic = target[scored], args.problem == "dynamic"
    names = args.estimators or OURS[args.problem] + (LIFTING if dynamic and output == "eps" else [])
    measured = (ready.target, *ready.measured)
    entries = candidates(args.problem, names, parameters=geometry, targets=measured, output=output)
    found: dict[str, tuple[float, float]] = {}
    for entry in entries:
        z, seconds = ours(entry, ready, splits)
        found[entry.label] = float(np.sqrt(np.mean((z - y) ** 2))), seconds
        print(f"{entry.label}: fitted", flush=True)
    read = candidates(args.problem, ["MLP"], parameters=geometry, targets=measured, output=output)[0].columns
    columns = [c for c in read if c not in ("trajectory", "initial")]  # the signals that a network of ours reads
    answers = {} if args.alone else peers(args, ready, splits, columns)
    failed = []
    for name in sorted({n.removesuffix("_seconds").removesuffix("_error") for n in answers if "_" in n}):
        if f"{name}_error" in answers:
            failed.append(f"{name} failed: {answers[f'{name}_error']}")
            continue
        parts = []
        for k, fold in enumerate(splits):
            fit, test = (fold.even_train, fold.even_test) if dynamic else (fold.fit_rows, fold.score_rows)
            z = answers[f"{name}{k}"][np.searchsorted(test, fold.score_rows)]
            if dynamic:  # held at the edge of the outputs of the fit, as ours are
                low, high = target[fit].min(), target[fit].max()
                room = 0.2 * (high - low)
                z = np.clip(np.nan_to_num(z, nan=high + room), low - room, high + room)
            parts.append(z)
        error = np.concatenate(parts) - y
        found[name] = float(np.sqrt(np.mean(error**2))), float(answers[f"{name}_seconds"])
    print(
        f"\n{args.problem} of {ready.target}, {args.data if args.data in ('twin', 'lifts') else 'log'}; {len(y)} rows, "
        f"{len(splits)} folds ({args.split}); spread of the target {np.std(y):.4g}"
    )
    width = max(map(len, found)) + 1
    print(f"{'':{width}s}      rmse   rmse / spread   fit / s of one core")
    for name, (error, seconds) in sorted(found.items(), key=lambda item: item[1][0]):
        print(f"{name:{width}s} {error:9.4g} {error / np.std(y):12.4f} {seconds:15.2f}")
    print("\n".join(failed))
    return 0


if __name__ == "__main__":
    sys.exit(main())

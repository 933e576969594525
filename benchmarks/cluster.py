"""A search on two dask workers against loky with two jobs, and with one of the workers killed during it."""

from __future__ import annotations

import argparse
import os
import signal
import threading
import time
import warnings

import numpy as np
import pandas as pd
from pamid.estimators import StaticPIHM
from sklearn.model_selection import GridSearchCV, GroupKFold

from pamid.distributed import on_dask


def data(n: int) -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    """Return signals, force and runs of a made-up muscle; how well the fits do does not matter for time."""
    rng = np.random.default_rng(0)
    low, high = [0.02, -0.5, 2e5, -1e6], [0.2, 0.5, 5e5, 1e6]
    X = pd.DataFrame(rng.uniform(low, high, (n, 4)), columns=["eps", "deps", "P", "dP"])
    F = (X["P"] - 101_325) * 5e-4 * (1 - 3 * X["eps"]) + rng.normal(0, 1.0, n)
    return X, F.to_numpy(), np.arange(n) * 12 // n


def search(fits: int, iterations: int, n_jobs: int | None) -> GridSearchCV:
    """Return a search of some fits, three folds a candidate."""
    grid = {"weight_decay": list(np.logspace(-8, -2, fits // 3))}
    model = StaticPIHM(hidden_layer_sizes=(24, 24), max_iter=iterations, validation_fraction=0, random_state=0)
    return GridSearchCV(model, grid, cv=GroupKFold(3), n_jobs=n_jobs, refit=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, help="searches of each kind, in turn (default: 3)")
    parser.add_argument("--fits", type=int, default=24, help="fits a search (default: 24)")
    parser.add_argument("--iterations", type=int, default=20, help="iterations a fit (default: 20)")
    parser.add_argument("--rows", type=int, default=1500, help="rows (default: 1500)")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    X, y, groups = data(args.rows)
    taken: dict[str, list[float]] = {"loky": [], "dask": []}
    scores = {}

    def once(kind: str, fits: int, n_jobs: int | None) -> float:
        started = time.perf_counter()
        scores[kind] = search(fits, args.iterations, n_jobs).fit(X, y, groups=groups).cv_results_["mean_test_score"]
        return time.perf_counter() - started

    with on_dask(n_workers=2) as client:
        import joblib

        for k in range(args.rounds + 1):  # the first round starts the workers and lets them import
            with joblib.parallel_config("loky"):
                spent = once("loky", args.fits if k else 6, 2)
            again = once("dask", args.fits if k else 6, None)
            if k:
                taken["loky"].append(spent)
                taken["dask"].append(again)
        ratios = np.array(taken["dask"]) / np.array(taken["loky"])
        print(f"search of {args.fits} fits on {args.rows:,} rows, medians of {args.rounds} in turn:")
        print(
            f"loky, 2 jobs {np.median(taken['loky']):6.2f} s   dask, 2 workers {np.median(taken['dask']):6.2f} s   "
            f"ratio {np.median(ratios):.3f} ({ratios.min():.3f} to {ratios.max():.3f}; target: at most 1.15)"
        )
        print(f"same scores: {np.array_equal(scores['loky'], scores['dask'])}")
        before = set(client.run(os.getpid).values())
        victim = min(before)
        threading.Timer(0.4 * float(np.median(taken["dask"])), os.kill, (victim, signal.SIGKILL)).start()
        spent = once("killed", args.fits, None)
        print(
            f"with one of the two workers killed on the way {spent:6.2f} s; worker replaced: "
            f"{victim not in client.run(os.getpid).values()}; same scores: "
            f"{np.array_equal(scores['loky'], scores['killed'])}"
        )


if __name__ == "__main__":
    main()

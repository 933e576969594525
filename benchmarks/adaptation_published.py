"""Table 2 and Figures 5 to 7 of the study on the simulated bench: Algorithms 1 and 2 as printed, FFT, PFT and LoRA.

A network is trained from scratch by Algorithm 1 on each of A, B and C; the one of A is the source of all adaptations,
which take every hundredth sample of the target. Everything else is as printed (`pamid.training.Adam`). ``--scratch``
and ``--epochs`` below the published 10,000 shorten Algorithm 1 and the adaptations; times are scaled up to 10,000.
Times are CPU seconds of one thread. A seed takes an hour and a half, with ``--scratch 250 --epochs 3000`` two minutes:
``--first-seed 3 --seeds 1`` runs one alone, ``--merge`` prints the table of several files, and
``benchmarks/adaptation_plots.py`` draws them.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch
from adaptation import COLUMNS, EPOCHS, TrueVolume, errors, log, loss, medians, show, sizes, source, timed
from pamid.estimators import FullFineTuning, LoRA, PartialFineTuning, QAdapter, ThermodynamicPIHM
from sklearn.frozen import FrozenEstimator

WINDOWS = {"D_tri": (18, 0.0, 9.0), "D_step": (4, 0.45, 0.8)}
"""Runs whose predictions are kept for Figures 6 and 7, and their time from and to, s."""
METHODS = ("FFT", "PFT", "LoRA", "Q")


def algorithm_1(muscle: str, data: Any, seed: int, epochs: int, **changed: Any) -> ThermodynamicPIHM:
    """Train from scratch as printed, in single precision, the quicker one for it."""
    options = {"volume_model": "neural", "dtype": "float32", "trainer": "adam", "max_iter": epochs}
    model = ThermodynamicPIHM(**sizes(muscle), **(options | changed), random_state=seed)
    return model.fit(data[COLUMNS[1:]], data["mdot"], groups=data["trajectory"])


def adaptation(method: str, source: Any, muscle: str, seed: int, epochs: int, **changed: Any) -> Any:
    """Return an unfitted adaptation, as printed but for what is changed."""
    options: dict[str, Any] = {"trainer": "adam", "max_iter": epochs, "random_state": seed} | changed
    if method == "Q":
        return QAdapter(source, **sizes(muscle), **options)
    return {"FFT": FullFineTuning, "PFT": PartialFineTuning, "LoRA": LoRA}[method](source, **options)


def table(args: argparse.Namespace, keep: Any) -> list[dict[str, Any]]:
    """Measure all methods; call `keep` after each row."""
    found: list[dict[str, Any]] = []
    for seed in range(args.first_seed, args.first_seed + args.seeds):

        def add(model: Any, muscle: str, method: str, seconds: float, data: Any, epochs: int, seed: int = seed) -> None:
            row = {"muscle": muscle, "seed": seed, "method": method, "parameters": model.n_parameters_}
            row |= {"samples": len(data), "loss": loss(model, data), "seconds": seconds}
            row |= errors(model, muscle, seed)
            if hasattr(model, "loss_curve_"):
                marks = np.unique(np.geomspace(1, len(model.loss_curve_), 150).round().astype(int))
                row |= {"epochs": marks.tolist(), "curve": [float(model.loss_curve_[k - 1]) for k in marks]}
                row["epochs_of"] = epochs
            if seed == 0 and muscle != "A":
                row["predictions"] = predictions(model, muscle)
            found.append(row)
            show(row)
            keep(found)

        whole = {m: log(f"D_{m}", m, seed) for m in "ABC"}
        trained = {}
        for muscle in ("A", *args.targets):
            model, seconds = timed(lambda m=muscle, s=seed, d=whole: algorithm_1(m, d[m], s, args.scratch))
            trained[muscle] = model
            add(model, muscle, "scratch, Algorithm 1", seconds * EPOCHS / args.scratch, whole[muscle], args.scratch)
        anchored = FrozenEstimator(source("anchored", "A", seed, args.steps))
        for muscle in args.targets:
            few = whole[muscle].iloc[::100]
            for method in METHODS:
                start = FrozenEstimator(trained["A"])
                estimator = adaptation(method, start, muscle, seed, args.epochs)
                model, seconds = timed(lambda e=estimator, d=few: e.fit(d[COLUMNS], d["mdot"]))
                add(model, muscle, f"{method}, as printed", seconds * EPOCHS / args.epochs, few, args.epochs)
            ours = QAdapter(anchored, **sizes(muscle), random_state=seed)
            model, seconds = timed(lambda e=ours, d=few: e.fit(d[COLUMNS], d["mdot"]))
            add(model, muscle, "QAdapter()", seconds, few, 1)
            if seed == 0:
                add(TrueVolume(muscle), muscle, "true volume", 0.0, whole[muscle], 0)
    return found


def predictions(model: Any, muscle: str) -> dict[str, Any]:
    """Return time, measured and predicted flow (kg/s) of one triangle and one step."""
    out = {}
    for name, (run, start, stop) in WINDOWS.items():
        d = log(name, muscle, 0)
        d = d[(d["trajectory"] == d["trajectory"].unique()[run]) & d["time"].between(start, stop)]
        X = d[COLUMNS[1:]] if isinstance(model, ThermodynamicPIHM) else d[COLUMNS]
        columns = {"time": d["time"], "measured": d["mdot"], "predicted": model.predict(X)}
        out[name] = {"run": str(d["trajectory"].iloc[0])} | {k: np.asarray(v).tolist() for k, v in columns.items()}
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="seeds of noise, weights and draws (default 5)")
    parser.add_argument("--first-seed", type=int, default=0, help="where the seeds start (default 0)")
    parser.add_argument("--targets", nargs="+", default=["B", "C"], choices=["B", "C"], help="target muscles")
    parser.add_argument("--scratch", type=int, default=EPOCHS, help="epochs of Algorithm 1 (default 10000)")
    parser.add_argument("--epochs", type=int, default=EPOCHS, help="epochs of the adaptations (default 10000)")
    parser.add_argument("--steps", type=int, default=60, help="steps of the anchored source (default 60)")
    parser.add_argument("--out", metavar="FILE.json", help="where to keep all figures, as they come")
    parser.add_argument("--merge", nargs="+", metavar="FILE.json", help="print the table that earlier runs kept")
    args = parser.parse_args()
    if args.merge:
        medians([row for f in args.merge for row in json.loads(Path(f).read_text(encoding="utf-8"))["published"]])
        return
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")

    def keep(found: list[dict[str, Any]]) -> None:
        if args.out:
            Path(args.out).write_text(json.dumps({"published": found}), encoding="utf-8")

    medians(table(args, keep))


if __name__ == "__main__":
    main()

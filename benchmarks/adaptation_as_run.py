"""Loss curves of Algorithms 1 and 2 on the twin as their authors ran them, beside the authors' logged losses.

Runs of the published length at 1 kHz (393 s, 387 s of muscle C), every tenth row from scratch, every thousandth to
adapt, four fifths of the rows drawn at random to train (`pamid.training.AdamAsRun`). Losses are in (NL/min)²; those of
the authors are quoted from their public notebooks (github.com/GenmengWANG/FastAdaptationOfPIHTM). The twin's flow has
another spread and fewer extremes than theirs, which the command prints: epochs compare, levels as shares of the start.
"""

from __future__ import annotations

import argparse
import json
import math
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from adaptation import COLUMNS, sizes
from pamid.estimators import QAdapter, RateTransformer, ThermodynamicPIHM
from scipy.stats import kurtosis
from sklearn.frozen import FrozenEstimator

from pamid.bench import BenchParameters, simulate, sine, unfold

NORMAL_LITRE = 2.1542e-5
"""kg/s of one NL/min at 1.2925 kg/m³."""
ROWS = {"A": 393_300, "B": 393_300, "C": 386_900}
"""Rows of the twenty runs at 1 kHz."""
AUTHORS = {
    "B from scratch": {1: 268.33, 100: 263.06, 200: 240.49, 500: 77.25, 700: 7.29, 1000: 5.51, 2000: 4.92, 3177: 4.13},
    "Q on B": {1: 1.2963, 100: 1.2899, 200: 1.2843, 500: 1.2662, 1000: 1.2387},
}
"""Training losses by epoch, (NL/min)²."""


def runs(muscle: str, seed: int) -> pd.DataFrame:
    """Simulate the twenty sines in their length, the upper muscle with its rates."""
    bench = BenchParameters.for_muscle(muscle)
    trajectories = [
        sine(frequency, amplitude, ROWS[muscle] // 20, phase=2.0 * math.pi * k / 5)
        for frequency in (1.0, 2.0, 4.0, 10.0)
        for k, amplitude in enumerate((5.0, 10.0, 15.0, 20.0, 25.0))
    ]
    table = unfold(simulate(bench, trajectories, seed=seed), bench)
    table = table[table["muscle"] == 1].reset_index(drop=True)[["trajectory", "time", "eps", "P", "mdot"]]
    return RateTransformer(columns=("eps", "P"), smooth=True).fit_transform(table)


def split(table: pd.DataFrame, stride: int, seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Thin, and draw four fifths of the rows to train."""
    rows = table.iloc[::stride]
    order = np.random.default_rng(seed).permutation(len(rows))
    first = round(0.8 * len(rows))
    return rows.iloc[order[:first]], rows.iloc[order[first:]]


def left(model: Any, rows: pd.DataFrame) -> float:
    columns = COLUMNS[1:] if isinstance(model, ThermodynamicPIHM) else COLUMNS
    return float(np.mean(((model.predict(rows[columns]) - rows["mdot"]) / NORMAL_LITRE) ** 2))


def scratch(muscle: str, table: pd.DataFrame, seed: int, epochs: int) -> tuple[ThermodynamicPIHM, dict[str, Any]]:
    train, test = split(table, 10, seed)
    options = {"volume_model": "neural", "trainer": "adam_as_run", "dtype": "float32", "validation_fraction": 0.0}
    begin = time.process_time()
    model = ThermodynamicPIHM(**sizes(muscle), **options, gas_constant=263.8, max_iter=epochs, random_state=seed)
    model.fit(train[COLUMNS[1:]], train["mdot"])
    flow = table["mdot"] / NORMAL_LITRE
    row = {"rows": len(train), "spread": float(flow.std()), "kurtosis": float(kurtosis(flow, fisher=False))}
    row |= {"curve": [float(v) for v in model.loss_curve_], "test": left(model, test)}
    return model, row | {"seconds": time.process_time() - begin}


def shown(name: str, row: dict[str, Any]) -> None:
    print(f"\n{name}: {row['rows']} rows, {row['seconds']:.0f} s, test loss {row['test']:.4g}")
    if "spread" in row:
        print(f"flow: spread {row['spread']:.2f} NL/min, kurtosis {row['kurtosis']:.1f}")
    theirs = AUTHORS.get(name, {})
    curve = row["curve"]
    marks = sorted(
        {*(e for e in theirs if e <= len(curve)), *(e for e in (50, 300, 400) if e <= len(curve)), len(curve)}
    )
    for epoch in marks:
        quoted = f"{theirs[epoch]:9.4g}" if epoch in theirs else " " * 9
        print(f"epoch {epoch:5d}: {curve[epoch - 1]:9.4g}   authors {quoted}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scratch", type=int, default=3177, help="epochs from scratch on B (default: 3177)")
    parser.add_argument("--source", type=int, default=3177, help="epochs of the source A (default: 3177)")
    parser.add_argument("--epochs", type=int, default=1000, help="epochs of the adaptation (default: 1000)")
    parser.add_argument("--seed", type=int, default=66, help="seed of noise, weights and rows (default: 66)")
    parser.add_argument("--out", type=Path, help="where to keep the curves, .json")
    parser.add_argument("--plot", type=Path, help="where to draw them")
    args = parser.parse_args()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")
    found: dict[str, Any] = {}

    def keep(name: str, row: dict[str, Any]) -> None:
        found[name] = row
        shown(name, row)
        if args.out:
            args.out.write_text(json.dumps(found), encoding="utf-8")

    target = runs("B", args.seed)
    keep("B from scratch", scratch("B", target, args.seed, args.scratch)[1])
    if args.source:
        source, row = scratch("A", runs("A", args.seed), args.seed, args.source)
        keep("A from scratch", row)
        train, test = split(target, 1000, args.seed)
        begin = time.process_time()
        adapter = QAdapter(FrozenEstimator(source), **sizes("B"), trainer="adam_as_run", max_iter=args.epochs)
        adapter.set_params(random_state=args.seed).fit(train[COLUMNS], train["mdot"])
        row = {"rows": len(train), "curve": [float(v) for v in adapter.loss_curve_], "test": left(adapter, test)}
        keep("Q on B", row | {"seconds": time.process_time() - begin})
    if args.plot:
        draw(found, args.plot)


def draw(found: dict[str, Any], path: Path) -> None:
    """Draw ours and theirs, each as a share of its first loss."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = [name for name in AUTHORS if name in found]
    figure, axes = plt.subplots(1, len(names), figsize=(5 * len(names), 3.5), squeeze=False)
    for ax, name in zip(axes[0], names, strict=True):
        curve = np.array(found[name]["curve"])
        ax.plot(np.arange(1, len(curve) + 1), curve / curve[0], label="twin, as run")
        theirs = AUTHORS[name]
        ax.plot(list(theirs), np.array(list(theirs.values())) / theirs[1], "o--", label="authors' notebook")
        ax.set(title=name, xlabel="epoch", ylabel="training loss / first", xscale="log")
        ax.set_yscale("log" if name != "Q on B" else "linear")
        ax.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()

"""Algorithms 1 and 2 as their authors ran them: loss curves beside the authors' logged ones, and Table 2.

Runs at 1 kHz, every tenth row from scratch, every thousandth to adapt, four fifths of the rows drawn at random to train
(`pamid.training.AdamAsRun`). Losses are in (NL/min)², errors in NL/min; those of the authors are quoted from their
public notebooks (github.com/GenmengWANG/FastAdaptationOfPIHTM) and their paper. ``--data paper_like`` takes the data
set that is like theirs, ``--data twin`` the study's twenty sines in equal runs. The authors' log of Q on B follows up
to four runs of a thousand epochs (inferred from the counters of its cells): ``--before`` epochs precede ours.
``--table`` fits FFT, PFT and LoRA as well, and C.
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
from adaptation_published import METHODS, adaptation
from pamid.estimators import RateTransformer, ThermodynamicPIHM
from scipy.stats import kurtosis, spearmanr
from sklearn.frozen import FrozenEstimator

from pamid.bench import BenchParameters, dataset, paper_like_bench, simulate, sine, unfold

NORMAL_LITRE = 2.1542e-5
"""kg/s of one NL/min at 1.2925 kg/m³."""
ROWS = {"A": 393_300, "B": 393_300, "C": 386_900}
"""Rows of the twenty runs at 1 kHz."""
AUTHORS = {
    "B from scratch": {1: 268.33, 100: 263.06, 200: 240.49, 500: 77.25, 700: 7.29, 1000: 5.51, 2000: 4.92, 3177: 4.13},
    "Q on B": {1: 1.2963, 100: 1.2899, 200: 1.2843, 500: 1.2662, 1000: 1.2387},
}
"""Training losses by epoch, (NL/min)²."""
COLUMN = ("scratch", *METHODS)
PAPER = {
    "B": {"target": (1.17, 1.86, 1.83, 1.40, 1.14), "tri": (1.14, 1.56, 1.83, 1.43, 1.18)}
    | {"step": (3.42, 3.38, 3.43, 3.61, 3.60)},
    "C": {"target": (1.96, 2.50, 4.68, 2.29, 1.65), "tri": (1.44, 1.50, 3.59, 1.44, 2.21)}
    | {"step": (2.47, 2.55, 3.46, 2.50, 2.61)},
}
"""Table 2: errors, by muscle and set, of the methods of `COLUMN`."""


def paper_like(kind: str, muscle: str, seed: int) -> pd.DataFrame:
    """Return the upper muscle of a data set that is like the authors', with its rates."""
    table = unfold(dataset(f"paper_like{kind}", seed=seed, muscle=muscle), paper_like_bench(muscle))
    return with_rates(table)


def with_rates(table: pd.DataFrame) -> pd.DataFrame:
    table = table[table["muscle"] == 1].reset_index(drop=True)[["trajectory", "time", "eps", "P", "mdot"]]
    return RateTransformer(columns=("eps", "P"), smooth=True).fit_transform(table)


def twin(muscle: str, seed: int) -> pd.DataFrame:
    """Simulate the twenty sines in equal runs of the authors' length, the upper muscle with its rates."""
    bench = BenchParameters.for_muscle(muscle)
    trajectories = [
        sine(frequency, amplitude, ROWS[muscle] // 20, phase=2.0 * math.pi * k / 5)
        for frequency in (1.0, 2.0, 4.0, 10.0)
        for k, amplitude in enumerate((5.0, 10.0, 15.0, 20.0, 25.0))
    ]
    return with_rates(unfold(simulate(bench, trajectories, seed=seed), bench))


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
    marks = sorted({e for e in (*theirs, 50, 300, 400, 600, 800, len(curve)) if e <= len(curve)})
    if "errors" in row:
        print(", ".join(f"{k} {v:.3f}" for k, v in row["errors"].items()), "NL/min")
    for epoch in marks:
        quoted = f"{theirs[epoch]:9.4g}" if epoch in theirs else " " * 9
        print(f"epoch {epoch:5d}: {curve[epoch - 1]:9.4g}   authors {quoted}", flush=True)


def adapted(
    method: str, source: Any, muscle: str, table: pd.DataFrame, seed: int, epochs: int
) -> tuple[Any, dict[str, Any]]:
    """Adapt to every thousandth row; the loss is that of the rows that train."""
    train, test = split(table, 1000, seed)
    begin = time.process_time()
    model = adaptation(method, source, muscle, seed, epochs, trainer="adam_as_run").fit(train[COLUMNS], train["mdot"])
    row = {"rows": len(train), "curve": [float(v) for v in model.loss_curve_], "test": left(model, test)}
    return model, row | {"seconds": time.process_time() - begin}


def errors(model: Any, sets: dict[str, pd.DataFrame], loss: float) -> dict[str, float]:
    """Return root mean square errors by set, NL/min; that of the samples that trained is the root of their loss."""
    return {"samples": math.sqrt(loss)} | {name: math.sqrt(left(model, rows)) for name, rows in sets.items()}


def compare(table: dict[str, dict[str, dict[str, float]]]) -> None:
    """Print errors beside those of Table 2, with their rank correlation.

    The paper's target task is compared twice: Q's 1.14 on B is the root of the authors' loss on the 315 samples.
    """
    for muscle, found in table.items():
        for name, theirs in [("samples", PAPER[muscle]["target"]), *PAPER[muscle].items()]:
            if set(found) == set(COLUMN):
                ours = [found[method][name] for method in COLUMN]
                cells = ", ".join(f"{m} {a:.2f} ({b:.2f})" for m, a, b in zip(COLUMN, ours, theirs, strict=True))
                print(f"{muscle} {name:7s} {cells}; rank correlation {spearmanr(ours, theirs).statistic:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", choices=["twin", "paper_like"], default="paper_like", help="(default: paper_like)")
    parser.add_argument("--scratch", type=int, default=3177, help="epochs from scratch (default: 3177)")
    parser.add_argument("--source", type=int, default=3177, help="epochs of the source A, 0 for none (default: 3177)")
    parser.add_argument("--epochs", type=int, default=1000, help="epochs of Q that are compared (default: 1000)")
    parser.add_argument("--before", type=int, default=4000, help="epochs of Q before them (default: 4000)")
    parser.add_argument("--table", type=int, metavar="EPOCHS", default=0, help="also Table 2, adapting so many epochs")
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

    def runs(muscle: str) -> pd.DataFrame:
        return twin(muscle, args.seed) if args.data == "twin" else paper_like("", muscle, args.seed)

    target = runs("B")
    model, row = scratch("B", target, args.seed, args.scratch)
    keep("B from scratch", row)
    if args.source:
        source, row = scratch("A", runs("A"), args.seed, args.source)
        source = FrozenEstimator(source)
        keep("A from scratch", row)
        _, row = adapted("Q", source, "B", target, args.seed, args.before + args.epochs)
        row["curve"] = row["curve"][args.before :]
        keep("Q on B", row)
    if args.plot:
        draw(found, args.plot, shares=args.data == "twin")
    table: dict[str, dict[str, dict[str, float]]] = {}
    for muscle in "BC" if args.table and args.source else "":
        target = target if muscle == "B" else runs(muscle)
        sets = {"target": target.iloc[::10]}
        sets |= {kind: paper_like(f"_{kind}", muscle, args.seed).iloc[::10] for kind in ("tri", "step")}
        table[muscle] = {}
        for method in METHODS:
            fitted, row = adapted(method, source, muscle, target, args.seed, args.table)
            table[muscle][method] = row["errors"] = errors(fitted, sets, row["curve"][-1])
            keep(f"{method} to {muscle}", row)
        if muscle == "C":
            model, row = scratch(muscle, target, args.seed, args.scratch)
            keep("C from scratch", row)
        table[muscle]["scratch"] = errors(model, sets, found[f"{muscle} from scratch"]["curve"][-1])
        compare({muscle: table[muscle]})
        found["table"] = table
        if args.out:
            args.out.write_text(json.dumps(found), encoding="utf-8")


def draw(found: dict[str, Any], path: Path, shares: bool) -> None:
    """Draw ours and theirs, on the twin as shares of the first loss."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = [name for name in AUTHORS if name in found]
    figure, axes = plt.subplots(1, len(names), figsize=(5 * len(names), 3.5), squeeze=False)
    for ax, name in zip(axes[0], names, strict=True):
        curve, theirs = np.array(found[name]["curve"]), AUTHORS[name]
        unit = (curve[0], theirs[1]) if shares else (1.0, 1.0)
        ax.plot(np.arange(1, len(curve) + 1), curve / unit[0], label="ours, as run")
        ax.plot(list(theirs), np.array(list(theirs.values())) / unit[1], "o--", label="authors' notebook")
        ax.set(title=name, xlabel="epoch", ylabel="training loss" + (" / first" if shares else " / (NL/min)²"))
        if name == "Q on B":
            ax.set_ylim(bottom=0.0)
        else:
            ax.set(xscale="log", yscale="log")
        ax.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()

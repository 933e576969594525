"""Algorithms 1 and 2 as their authors ran them: loss curves beside the authors' logged ones, and Table 2.

Runs at 1 kHz, every tenth row from scratch, every thousandth to adapt, four fifths of the rows drawn at random to train
(`pamid.training.AdamAsRun`). Losses are in (NL/min)², errors in NL/min; those of the authors are quoted from their
public notebooks (github.com/GenmengWANG/FastAdaptationOfPIHTM) and their paper. ``--data paper_like`` takes the data
set that is like theirs, ``--data twin`` the study's twenty sines in equal runs. The authors' log of Q on B follows up
to four runs of a thousand epochs (inferred from the counters of its cells): ``--before`` epochs precede ours.
``--table`` fits FFT, PFT and LoRA as well, and C. ``--out`` is written after each part; ``--merge`` prints the medians
of several seeds' files and draws them into ``--folder`` (`_as_run_plots.py`).
"""

from __future__ import annotations

import argparse
import json
import math
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from _as_run_plots import pictures
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
PAPER_SECONDS = {"B": (195_804, 469, 472, 501, 471), "C": (194_437, 470, 490, 479, 463)}
PAPER_PARAMETERS = (17_281, 17_281, 640, 1_288, 17_282)
"""Table 2: seconds, by muscle, and trained parameters, of the same."""
WINDOWS = {"target": ("sine-4-20", 0.0, 3.2), "tri": ("triangle-4-20", 0.0, 3.2), "step": ("step-0-20", 0.9, 1.7)}
"""By set, the run whose prediction is kept, and its time from and to, s."""
SHOWN = 160
"""Samples of a kept prediction."""
Sets = dict[str, pd.DataFrame]


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


def predicted(model: Any, rows: pd.DataFrame) -> np.ndarray:
    """Return the flow, NL/min."""
    columns = COLUMNS[1:] if isinstance(model, ThermodynamicPIHM) else COLUMNS
    return np.asarray(model.predict(rows[columns]) / NORMAL_LITRE)


def left(model: Any, rows: pd.DataFrame) -> float:
    return float(np.mean((predicted(model, rows) - rows["mdot"] / NORMAL_LITRE) ** 2))


def judged(model: Any, sets: Sets, loss: float) -> dict[str, Any]:
    """Return root mean square errors by set, NL/min, and a stretch of a run of each.

    The error of the samples that trained is the root of their loss.
    """
    found = {name: math.sqrt(left(model, rows.iloc[::10])) for name, rows in sets.items()}
    kept = {}
    for name, (run, start, stop) in WINDOWS.items():
        rows = sets[name]
        rows = rows[rows["trajectory"].str.startswith(run) & rows["time"].between(start, stop)]
        rows = rows.iloc[:: -(-len(rows) // SHOWN)]
        columns = {"time": rows["time"], "measured": rows["mdot"] / NORMAL_LITRE, "predicted": predicted(model, rows)}
        kept[name] = {"run": run} | {k: np.round(np.asarray(v), 4).tolist() for k, v in columns.items()}
    return {"errors": {"samples": math.sqrt(loss)} | found, "predictions": kept}


def timed(fit: Callable[[], Any]) -> tuple[Any, dict[str, Any]]:
    """Call, and return what was fitted with its seconds, curve and number of trained parameters."""
    wall, begin = time.perf_counter(), time.process_time()
    model = fit()
    row = {"seconds": time.process_time() - begin, "wall": time.perf_counter() - wall}
    return model, row | {"parameters": int(model.n_parameters_), "curve": [float(v) for v in model.loss_curve_]}


def scratch(muscle: str, table: pd.DataFrame, seed: int, epochs: int) -> tuple[ThermodynamicPIHM, dict[str, Any]]:
    train, test = split(table, 10, seed)
    options = {"volume_model": "neural", "trainer": "adam_as_run", "dtype": "float32", "validation_fraction": 0.0}
    empty = ThermodynamicPIHM(**sizes(muscle), **options, gas_constant=263.8, max_iter=epochs, random_state=seed)
    model, row = timed(lambda: empty.fit(train[COLUMNS[1:]], train["mdot"]))
    flow = table["mdot"] / NORMAL_LITRE
    row |= {"rows": len(train), "spread": float(flow.std()), "kurtosis": float(kurtosis(flow, fisher=False))}
    return model, row | {"test": left(model, test)}


def shown(name: str, row: dict[str, Any]) -> None:
    print(f"\n{name}: {row['rows']} rows, {row['parameters']} parameters, {row['seconds']:.0f} s, ", end="")
    print(f"test loss {row['test']:.4g}")
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
    empty = adaptation(method, source, muscle, seed, epochs, trainer="adam_as_run")
    model, row = timed(lambda: empty.fit(train[COLUMNS], train["mdot"]))
    return model, row | {"rows": len(train), "test": left(model, test)}


def kept_name(method: str, muscle: str) -> str:
    return f"{muscle} from scratch" if method == "scratch" else f"{method} to {muscle}"


def compare(files: list[dict[str, Any]]) -> None:
    """Print Table 2, medians over seeds: errors beside those of the paper in brackets, and their rank correlations.

    The paper's target task is compared twice: Q's 1.14 on B is the root of the authors' loss on the 315 samples.
    """
    for muscle in PAPER:
        rows = {m: [f[kept_name(m, muscle)] for f in files if kept_name(m, muscle) in f] for m in COLUMN}
        rows = {m: [r for r in found if "errors" in r] for m, found in rows.items()}
        if not all(rows.values()):
            continue
        theirs = {"samples": PAPER[muscle]["target"], **PAPER[muscle]}
        columns = {name: [[r["errors"][name] for r in rows[m]] for m in COLUMN] for name in theirs}
        columns |= {key: [[r[key] for r in rows[m]] for m in COLUMN] for key in ("seconds", "parameters")}
        theirs |= {"seconds": PAPER_SECONDS[muscle], "parameters": PAPER_PARAMETERS}
        print(f"\n| {muscle} | {' | '.join(theirs)} |\n|{' --- |' * (len(theirs) + 1)}")
        for i, method in enumerate(COLUMN):
            cells = [
                cell(found[i], theirs[name][i], name in PAPER["B"] or name == "samples")
                for name, found in columns.items()
            ]
            print(f"| {method} | {' | '.join(cells)} |")
        ranks = [spearmanr([np.median(v) for v in found], theirs[name]).statistic for name, found in columns.items()]
        print(f"| rank correlation | {' | '.join(f'{r:.2f}' for r in ranks)} |", flush=True)


def cell(each: list[float], printed: float, error: bool) -> str:
    """Median over seeds, their range, and in brackets the paper's value."""
    digits = 2 if error else 0
    spread = f" {min(each):.{digits}f}–{max(each):.{digits}f}" if min(each) < max(each) else ""
    return f"{np.median(each):.{digits}f}{spread} ({printed:.{digits}f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", choices=["twin", "paper_like"], default="paper_like", help="(default: paper_like)")
    parser.add_argument("--scratch", type=int, default=3177, help="epochs from scratch (default: 3177)")
    parser.add_argument("--source", type=int, default=3177, help="epochs of the source A, 0 for none (default: 3177)")
    parser.add_argument("--epochs", type=int, default=1000, help="epochs of Q that are compared (default: 1000)")
    parser.add_argument("--before", type=int, default=4000, help="epochs of Q before them (default: 4000)")
    parser.add_argument("--table", type=int, metavar="EPOCHS", default=0, help="also Table 2, adapting so many epochs")
    parser.add_argument("--seed", type=int, default=66, help="seed of noise, weights and rows (default: 66)")
    parser.add_argument("--out", type=Path, help="where to keep curves, errors and predictions, .json")
    parser.add_argument("--merge", type=Path, nargs="+", metavar="FILE", help="print and draw what earlier runs kept")
    parser.add_argument("--folder", type=Path, help="where the pictures go")
    args = parser.parse_args()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore")
    files = [json.loads(file.read_text(encoding="utf-8")) for file in args.merge or ()]
    if files:
        compare(files)
    else:
        files = [measured(args)]
    if args.folder:
        pictures(files, AUTHORS, args.folder, shares=args.data == "twin")


def measured(args: argparse.Namespace) -> dict[str, Any]:
    """Train and adapt; what is found is kept after each part."""
    found: dict[str, Any] = {}

    def keep(name: str, row: dict[str, Any]) -> None:
        found[name] = row
        shown(name, row)
        if args.out:
            args.out.write_text(json.dumps(found), encoding="utf-8")

    def runs(muscle: str) -> Sets:
        if args.data == "twin":
            return {"target": twin(muscle, args.seed)}
        kinds = {"target": ""} | ({"tri": "_tri", "step": "_step"} if args.table and muscle != "A" else {})
        return {name: paper_like(kind, muscle, args.seed) for name, kind in kinds.items()}

    def from_scratch(muscle: str, sets: Sets, epochs: int) -> Any:
        model, row = scratch(muscle, sets["target"], args.seed, epochs)
        keep(f"{muscle} from scratch", row | (judged(model, sets, row["curve"][-1]) if len(sets) == 3 else {}))
        return model

    sets = runs("B")
    from_scratch("B", sets, args.scratch)
    if not args.source:
        return found
    source = FrozenEstimator(from_scratch("A", runs("A"), args.source))
    _, row = adapted("Q", source, "B", sets["target"], args.seed, args.before + args.epochs)
    keep("Q on B", row | {"curve": row["curve"][args.before :]})
    for muscle in PAPER if args.table else ():
        if muscle == "C":
            sets = runs(muscle)
            from_scratch(muscle, sets, args.scratch)
        for method in METHODS:
            model, row = adapted(method, source, muscle, sets["target"], args.seed, args.table)
            keep(kept_name(method, muscle), row | judged(model, sets, row["curve"][-1]))
        compare([found])
    return found


if __name__ == "__main__":
    main()

"""Named effects and scaled geometry carried between measured Festo muscles, against the best fresh fit of the samples.

The source is a muscle of 10 mm bore and 30 cm; targets are two of the same bore and one of 20 mm. ``--sources`` names
others, or ``all``, and prints ratios to the best fresh fit, sources by targets. A draw takes one row at random of each
of n equal stretches of the rows with F > 5 N of all repeats but the last; the last repeat of each contraction is
scored, rows with F > 5 N. The fresh fits are those of ``adaptation.py``, and with ``--own`` the same model without a
source, which reads the pressure's past as the carried one does. ``--festo`` names the folder of the data.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd
from _sources_kept import fresh
from festo import table
from pamid.estimators import CarriedForce
from sklearn.frozen import FrozenEstimator

MUSCLES = {
    "10mm_30cm": (0.281, 0.010, 0.232),
    "10mm_20cm": (0.182, 0.010, 0.152),
    "10mm_40cm": (0.382, 0.010, 0.314),
    "20mm_10cm": (0.098, 0.020, 0.076),
}
"""Beginning of the files' names: length and diameter at rest, length fully contracted, m."""
READ = ["trajectory", "time", "eps", "P"]
EVERY = 3
"""Rows of the last repeat that are scored: every third, 6 ms apart."""
OWN = "same model, no source"


def estimator(name: str, source: Any = None) -> CarriedForce:
    length, diameter, contracted = MUSCLES[name]
    limit = (length - contracted) / length
    return CarriedForce(source, rest_diameter=diameter, max_contraction=limit)


def fitted(name: str, log: pd.DataFrame, rows: np.ndarray, source: Any = None) -> CarriedForce:
    """Fit to some rows; the pressure of all runs but the last repeats is remembered."""
    train = ~log["last"].to_numpy()
    counted = np.zeros(len(log))
    counted[rows] = 1.0
    known = log[train]
    return estimator(name, source).fit(known[READ], known["F"], sample_weight=counted[train])


def drawn(rows: np.ndarray, count: int, seed: int) -> np.ndarray:
    """One row at random of each of equal stretches."""
    edges = np.linspace(0, len(rows), count + 1).astype(int)
    rng = np.random.default_rng(seed)
    return rows[[int(rng.integers(a, b)) for a, b in pairwise(edges)]]


def rmse(predicted: np.ndarray, test: pd.DataFrame) -> float:
    return float(np.sqrt(np.mean((predicted - test["F"].to_numpy()) ** 2)))


def draw(
    name: str, log: pd.DataFrame, count: int, seed: int, source: Any, own: bool, known: dict[Any, Any]
) -> dict[str, Any]:
    """Errors of one draw, N; the same model without a source if asked. What knows no source is kept in `known`."""
    above, last = (log["F"] > 5.0).to_numpy(), log["last"].to_numpy()
    few = drawn(np.flatnonzero(above & ~last), count, seed)
    whole = log[last]
    scored = np.flatnonzero((whole["F"] > 5.0).to_numpy())[::EVERY]
    test = whole.iloc[scored]
    model = fitted(name, log, few, source)
    row = {"muscle": name, "count": count, "seed": seed, "carried": rmse(model.predict(whole[READ])[scored], test)}
    row["kept"] = model.source_kept_
    errors = known.setdefault((name, count, seed), {})
    if not errors:
        if own:
            errors[OWN] = rmse(fitted(name, log, few).predict(whole[READ])[scored], test)
        for kind, (fit, columns) in fresh().items():
            errors[kind] = rmse(fit.fit(log.iloc[few][columns], log.iloc[few]["F"]).predict(test[columns]), test)
    return row | errors


def shown(d: pd.DataFrame) -> None:
    """Print medians, and ratios to the fresh kind whose median is least: of medians, and the worst of all draws."""
    print("\nRMSE / N: median (greatest); ratio of medians, worst ratio of a draw")
    for (name, count), g in d.groupby(["muscle", "count"], sort=False):
        kinds = list(fresh())
        line = (
            f"{name} {count:4d} samples, {len(g)} draws: carried {g['carried'].median():.2f} ({g['carried'].max():.2f})"
        )
        line += f", keeps {g['kept'].median():.0%}"
        for label, offered in (("", kinds), (" with past", [*kinds, OWN]))[: 1 + (OWN in g)]:
            best = min(offered, key=lambda kind, g=g: g[kind].median())
            each = g["carried"] / g[best]
            line += f"; best fresh{label}: {best} {g[best].median():.2f} ({g[best].max():.2f}), "
            line += f"ratio {g['carried'].median() / g[best].median():.2f}, worst {each.max():.2f}"
            line += f", of the worst {g['carried'].max() / g[best].max():.2f}"
        print(line, flush=True)


def crossed(d: pd.DataFrame) -> None:
    """Print ratios of medians and worst ratios of a draw, sources by targets."""
    kinds = list(fresh())
    for count, rows in d.groupby("count"):
        print(f"\n| {count} samples, source \\ target | {' | '.join(MUSCLES)} |\n|{' --- |' * (1 + len(MUSCLES))}")
        for source, own in rows.groupby("source", sort=False):
            cells = []
            for name in MUSCLES:
                g = own[own["muscle"] == name]
                best = min(kinds, key=lambda kind, g=g: g[kind].median()) if len(g) else ""
                each = g["carried"] / g[best] if len(g) else g.get("carried")
                cells.append(f"{g['carried'].median() / g[best].median():.2f} / {each.max():.2f}" if len(g) else "")
            print(f"| {source} | {' | '.join(cells)} |", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--festo", type=Path, help="folder of measured Festo logs")
    parser.add_argument("--counts", type=int, nargs="+", default=[25, 100, 400], help="samples")
    parser.add_argument("--seeds", type=int, default=10, help="draws (default: 10)")
    parser.add_argument("--first-seed", type=int, default=0, help="where the seeds start (default: 0)")
    parser.add_argument("--sources", nargs="+", choices=[*MUSCLES, "all"], default=["10mm_30cm"], help="source muscles")
    parser.add_argument("--muscles", nargs="+", choices=MUSCLES, help="targets (default: all others)")
    parser.add_argument("--own", action="store_true", help="the same model without a source as well")
    parser.add_argument("--out", type=Path, help="where to keep all draws, .csv")
    args = parser.parse_args()
    if args.festo is None or not list(args.festo.rglob("10mm_*cm_*.mat")):
        print("skipped: --festo DIR names the folder with the Festo logs, which are not part of this package")
        return 0
    warnings.simplefilter("ignore")
    sources = list(MUSCLES) if "all" in args.sources else args.sources
    logs = {n: table(sorted(args.festo.rglob(f"{n}_*.mat")), 2.0).reset_index(drop=True) for n in MUSCLES}
    found: list[dict[str, Any]] = []
    known: dict[Any, Any] = {}
    for name in sources:
        log = logs[name]
        source = fitted(name, log, np.flatnonzero((log["F"] > 5.0) & ~log["last"]))
        print(f"\nsource {name}", {k: f"{v:.4g} {source.units_[k]}" for k, v in source.parameters_.items()})
        print({k: round(v, 3) for k, v in source.memory_.items()})
        for target in args.muscles or MUSCLES:
            for count in args.counts if target != name else ():
                seeds = range(args.first_seed, args.first_seed + args.seeds)
                draws = [draw(target, logs[target], count, s, FrozenEstimator(source), args.own, known) for s in seeds]
                found += [{"source": name} | row for row in draws]
                shown(pd.DataFrame(draws))
                if args.out:
                    pd.DataFrame(found).to_csv(args.out, index=False)
    if len(sources) > 1:
        crossed(pd.DataFrame(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())

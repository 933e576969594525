"""Draw what ``benchmarks/adaptation.py --out FILE.json`` measured, and predictions on triangles and steps."""

from __future__ import annotations

import argparse
import json
import os
import warnings
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import matplotlib as mpl
import numpy as np
import pandas as pd

mpl.use("Agg")
from matplotlib import pyplot as plt

SETS = ("target", "tri", "step")
OURS = ("Q alone", "Q, pull chosen")
"""Adaptations drawn beside the published ones."""


def curves(found: list[dict[str, Any]], folder: Path) -> None:
    """Loss over the share of each method's own training time: Figure 5 of the study, with time in place of epochs."""
    fig, axis = plt.subplots(figsize=(6, 3.5), layout="constrained")
    latest = {(r["seed"], r["muscle"], r["method"]): r for r in found if "curve" in r}  # of two files the later one
    for row in latest.values():
        if not ("Adam" in row["method"] or row["method"] in OURS):
            continue
        if len(row["curve"]) > 1:
            seconds = np.linspace(0, row["seconds"], len(row["curve"]) + 1)[1:]
            axis.loglog(seconds, row["curve"], label=row["method"])
        else:
            axis.plot(row["seconds"], row["curve"][0], "k*", label=row["method"])
    axis.set(
        xlabel="CPU time of the adaptation / s", ylabel="loss / variance of the target", title="A to B, 315 samples"
    )
    axis.legend(fontsize=7)
    fig.savefig(folder / "adaptation-loss.png", dpi=120)


def counts(found: list[dict[str, Any]], folder: Path) -> None:
    """Held-out error over the number of adaptation samples."""
    d = pd.DataFrame(found)
    muscles = sorted(d["muscle"].unique())
    fig, axes = plt.subplots(len(muscles), 3, figsize=(9, 2.8 * len(muscles)), layout="constrained", squeeze=False)
    for i, muscle in enumerate(muscles):
        for axis, name in zip(axes[i], SETS, strict=True):
            for method, g in d[d["muscle"] == muscle].groupby("method", sort=False):
                v = g.groupby("count")[name]
                axis.loglog(v.median().index, 1e6 * v.median(), "o-", ms=3, label=method)
                axis.fill_between(v.min().index, 1e6 * v.min(), 1e6 * v.max(), alpha=0.15)
            axis.set(title=f"{muscle}, {name}", xlabel="adaptation samples", ylabel="RMSE / 1e-6 kg/s")
            axis.set_xticks(sorted(d["count"].unique()), minor=False)
            axis.minorticks_off()
            low, high = axis.get_ylim()
            axis.set_yticks([v for k in (1, 10, 100) for v in (1 * k, 2 * k, 3 * k, 5 * k, 7 * k) if low <= v <= high])
            for scale in (axis.xaxis, axis.yaxis):
                scale.set_major_formatter("{x:g}")
    axes[0][0].legend(fontsize=7)
    fig.savefig(folder / "adaptation-samples.png", dpi=120)


def scaling(found: list[dict[str, Any]], folder: Path) -> None:
    """Draw time and memory of a step over samples and width."""
    d = pd.DataFrame(found)
    fig, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    for width, g in d.groupby("width"):
        (line,) = axes[0].loglog(g["n"], 1e3 * g["seconds"], "o-", ms=3, label=f"width {width}")
        axes[0].loglog(g["n"], 1e3 * g["floor"], ":", color=line.get_color())
        seen = g[g["bytes"] > 2**19]  # less hides in memory that is held already
        axes[1].loglog(seen["n"], seen["bytes"] / 2**20, "o-", ms=3, color=line.get_color())
    axes[0].set(xlabel="samples", ylabel="CPU ms a step (dotted: products alone)")
    axes[1].set(xlabel="samples", ylabel="MiB above the start")
    axes[0].legend(fontsize=7)
    fig.savefig(folder / "adaptation-scaling.png", dpi=120)


def predictions(folder: Path, muscle: str, steps: int) -> None:
    """Figures 6 and 7 of the study: flow on a triangle and on a step, of the model from scratch and the adapted one."""
    from adaptation import COLUMNS, log, sizes, source  # the neighbouring benchmark
    from pamid.estimators import QAdapter

    few = log(f"D_{muscle}", muscle, 0).iloc[::100]
    scratch = source("neural", muscle, 0, steps)
    adapted = QAdapter(source("anchored", "A", 0, steps), **sizes(muscle), random_state=0).fit(
        few[COLUMNS], few["mdot"]
    )
    fig, axes = plt.subplots(2, 2, figsize=(9, 4.6), layout="constrained", sharex="col", height_ratios=(3, 2))
    for column, (name, run, window) in enumerate((("D_tri", 18, (0.0, np.inf)), ("D_step", 4, (0.45, 0.8)))):
        d = log(name, muscle, 0)
        d = d[(d["trajectory"] == d["trajectory"].unique()[run]) & d["time"].between(*window)]
        upper, lower = axes[:, column]
        upper.plot(d["time"], 1e3 * d["mdot"], color="0.7", lw=2.5, label="measured")
        for model, columns, style, label in (
            (scratch, COLUMNS[1:], "-", "published network, from scratch"),
            (adapted, COLUMNS, "--", f"adapted from A, {len(few)} samples"),
        ):
            flow = 1e3 * model.predict(d[columns])
            upper.plot(d["time"], flow, style, lw=0.9, label=label)
            lower.plot(d["time"], flow - 1e3 * d["mdot"], style, lw=0.7)
        upper.set(title=f"{muscle}: {d['trajectory'].iloc[0]}", ylabel="flow / g/s")
        lower.set(xlabel="time / s", ylabel="error / g/s")
    fig.legend(*axes[0][0].get_legend_handles_labels(), fontsize=8, ncols=3, loc="outside lower center")
    fig.savefig(folder / f"adaptation-predictions-{muscle}.png", dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="results of benchmarks/adaptation.py --out")
    parser.add_argument("--folder", default="docs/images", help="where the pictures go (default docs/images)")
    parser.add_argument(
        "--predictions", nargs="*", default=[], choices=["B", "C"], help="draw predictions for these muscles"
    )
    parser.add_argument("--steps", type=int, default=40, help="steps of the trained models (default 40)")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    folder = Path(args.folder)
    folder.mkdir(parents=True, exist_ok=True)
    draw = {"table": curves, "samples": counts, "scaling": scaling}
    kept: dict[str, list[dict[str, Any]]] = {}
    for file in args.files:
        for part, found in json.loads(Path(file).read_text(encoding="utf-8")).items():
            kept.setdefault(part, []).extend(found)
    for part, found in kept.items():
        if part in draw and found:
            draw[part](found, folder)
    for muscle in args.predictions:
        predictions(folder, muscle, args.steps)


if __name__ == "__main__":
    main()

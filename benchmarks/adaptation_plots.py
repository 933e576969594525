"""Draw what ``adaptation_published.py`` and ``adaptation.py`` measured: losses, predictions, samples, costs."""

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


def curves(found: list[dict[str, Any]], folder: Path) -> None:
    """Loss over the epochs, from scratch and adapted: Figure 5 of the study."""
    muscles = sorted({r["muscle"] for r in found if r["method"].endswith("as printed")})
    fig, axes = plt.subplots(1, len(muscles), figsize=(4.5 * len(muscles), 3.4), layout="constrained", squeeze=False)
    for axis, muscle in zip(axes[0], muscles, strict=True):
        own = [r for r in found if r["muscle"] == muscle and len(r.get("curve", ())) > 1]
        for i, method in enumerate(dict.fromkeys(r["method"] for r in own)):
            for k, row in enumerate(r for r in own if r["method"] == method):
                label = method.replace(", as printed", "") if k == 0 else None
                axis.loglog(row["epochs"], row["curve"], color=f"C{i}", lw=0.9, label=label)
        axis.set(title=f"muscle {muscle}", xlabel="epochs", ylabel="loss / variance of the target")
    fig.legend(*axes[0][0].get_legend_handles_labels(), fontsize=8, ncols=6, loc="outside lower center")
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


def predictions(found: list[dict[str, Any]], folder: Path) -> None:
    """Figures 6 and 7 of the study: flow on a triangle and a step, by Algorithm 1 from scratch and by Algorithm 2."""
    kept = {(r["muscle"], r["method"]): r["predictions"] for r in found if "predictions" in r}
    for muscle in sorted({m for m, method in kept if method == "Q, as printed"}):
        fig, axes = plt.subplots(2, 2, figsize=(9, 4.6), layout="constrained", sharex="col", height_ratios=(3, 2))
        for column, name in enumerate(("D_tri", "D_step")):
            upper, lower = axes[:, column]
            for method, style, label in (
                ("scratch, Algorithm 1", "-", "Algorithm 1, from scratch"),
                ("Q, as printed", "--", "Algorithm 2, adapted from A"),
            ):
                run = kept[muscle, method][name]
                time, measured, flow = (np.array(run[k]) for k in ("time", "measured", "predicted"))
                if style == "-":
                    upper.plot(time, 1e3 * measured, color="0.7", lw=2.5, label="measured")
                upper.plot(time, 1e3 * flow, style, lw=0.9, label=label)
                lower.plot(time, 1e3 * (flow - measured), style, lw=0.7)
                upper.set(title=f"{muscle}: {run['run']}", ylabel="flow / g/s")
                lower.set(xlabel="time / s", ylabel="error / g/s")
        fig.legend(*axes[0][0].get_legend_handles_labels(), fontsize=8, ncols=3, loc="outside lower center")
        fig.savefig(folder / f"adaptation-predictions-{muscle}.png", dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="results of --out FILE.json of either benchmark")
    parser.add_argument("--folder", default="docs/images", help="where the pictures go (default docs/images)")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    folder = Path(args.folder)
    folder.mkdir(parents=True, exist_ok=True)
    draw = {"published": (curves, predictions), "samples": (counts,), "scaling": (scaling,)}
    kept: dict[str, list[dict[str, Any]]] = {}
    for file in args.files:
        for part, found in json.loads(Path(file).read_text(encoding="utf-8")).items():
            kept.setdefault(part, []).extend(found)
    for part, found in kept.items():
        for picture in draw.get(part, ()) if found else ():
            picture(found, folder)


if __name__ == "__main__":
    main()

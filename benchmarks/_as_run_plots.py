"""Draw what ``adaptation_as_run.py`` kept: losses beside the authors', losses of all methods, and predictions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

SETS = ("target", "tri", "step")
METHODS = ("FFT", "PFT", "LoRA", "Q")


def pictures(files: list[dict[str, Any]], authors: dict[str, dict[int, float]], folder: Path, shares: bool) -> None:
    """Draw all that the files hold; on the twin losses are shares of the first."""
    import matplotlib as mpl

    mpl.use("Agg")
    folder.mkdir(parents=True, exist_ok=True)
    beside(files, authors, folder / "adaptation-as-run.png", shares)
    muscles = [m for m in "BC" if any(f"Q to {m}" in f for f in files)]
    if muscles:
        losses(files, muscles, folder / "adaptation-as-run-loss.png")
    for muscle in muscles:
        predictions(files[0], muscle, folder / f"adaptation-as-run-predictions-{muscle}.png")


def beside(files: list[dict[str, Any]], authors: dict[str, dict[int, float]], path: Path, shares: bool) -> None:
    """Training losses of all seeds, and those that the authors logged."""
    from matplotlib import pyplot as plt

    names = [name for name in authors if any(name in f for f in files)]
    fig, axes = plt.subplots(1, len(names), figsize=(5 * len(names), 3.5), squeeze=False, layout="constrained")
    for ax, name in zip(axes[0], names, strict=True):
        theirs = authors[name]
        for k, curve in enumerate(np.array(f[name]["curve"]) for f in files if name in f):
            unit = curve[0] if shares else 1.0
            label = None if k else "pamid, as run"
            ax.plot(np.arange(1, len(curve) + 1), curve / unit, color="C0", lw=1.0, label=label)
        unit = theirs[1] if shares else 1.0
        ax.plot(list(theirs), np.array(list(theirs.values())) / unit, "o--", color="C1", label="authors' notebook")
        ax.set(title=name, xlabel="epoch", ylabel="training loss" + (" / first" if shares else " / (NL/min)²"))
        if name == "Q on B":
            ax.set_ylim(bottom=0.0)
        else:
            ax.set(xscale="log", yscale="log")
        ax.legend()
    fig.savefig(path, dpi=110)


def losses(files: list[dict[str, Any]], muscles: list[str], path: Path) -> None:
    """Loss over the epochs, from scratch and adapted: Figure 5 of the study."""
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(1, len(muscles), figsize=(4.5 * len(muscles), 3.4), squeeze=False, layout="constrained")
    for ax, muscle in zip(axes[0], muscles, strict=True):
        for i, name in enumerate((f"{muscle} from scratch", *(f"{m} to {muscle}" for m in METHODS))):
            for k, curve in enumerate(np.array(f[name]["curve"]) for f in files if name in f):
                marks = np.unique(np.geomspace(1, len(curve), 300).round().astype(int))
                label = None if k else ("from scratch" if i == 0 else METHODS[i - 1])
                ax.loglog(marks, curve[marks - 1], color=f"C{i}", lw=0.9, label=label)
        ax.set(title=f"muscle {muscle}", xlabel="epoch", ylabel="training loss / (NL/min)²")
    fig.legend(*axes[0][0].get_legend_handles_labels(), fontsize=8, ncols=5, loc="outside lower center")
    fig.savefig(path, dpi=110)


def predictions(found: dict[str, Any], muscle: str, path: Path) -> None:
    """Flow of all methods on a stretch of each set, and its error: Figures 6 and 7 of the study."""
    from matplotlib import pyplot as plt

    fig, axes = plt.subplots(2, len(SETS), figsize=(12, 5), sharex="col", height_ratios=(3, 2), layout="constrained")
    for i, name in enumerate((f"{muscle} from scratch", *(f"{m} to {muscle}" for m in METHODS))):
        for column, kind in enumerate(SETS if "predictions" in found.get(name, {}) else ()):
            upper, lower = axes[:, column]
            run = found[name]["predictions"][kind]
            time, measured, flow = (np.array(run[k]) for k in ("time", "measured", "predicted"))
            if i == 0:
                upper.plot(time, measured, color="0.7", lw=2.5, label="measured")
            upper.plot(time, flow, color=f"C{i}", lw=0.9, label="from scratch" if i == 0 else METHODS[i - 1])
            lower.plot(time, flow - measured, color=f"C{i}", lw=0.7)
            upper.set(title=f"{muscle}: {run['run']}", ylabel="flow / (NL/min)")
            lower.set(xlabel="time / s", ylabel="error / (NL/min)")
    fig.legend(*axes[0][0].get_legend_handles_labels(), fontsize=8, ncols=6, loc="outside lower center")
    fig.savefig(path, dpi=110)

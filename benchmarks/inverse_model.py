"""The inverse model's study: training, unseen sets under unseen loads, a long faster run; plots and rivals."""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from pamid.estimators import GeometricForce, InverseModel, InvertedForce, RateTransformer, StaticPIHM

from pamid.bench.single import LOADS, LiftSettings, festo_like, simulate_lift
from pamid.plots.style import BLUE, GREY, INK, new_figure, save_figure, style

UNSEEN = (20.0, 37.0, 70.0, 92.0)
SET = 85
COLUMNS = ["trajectory", "F", "eps", "deps"]


def lifts(loads: tuple[float, ...], seed: int, frequency: float = 0.05, periods: float = 1.0) -> pd.DataFrame:
    """Lift loads on the twin; 50 rows a second, with the rate of the contraction."""
    settings = LiftSettings(frequency=frequency)
    log = simulate_lift(loads=loads, periods=periods, every=20, seed=seed, settings=settings)
    rates = RateTransformer(("eps",), tuning=5.0).fit_transform(log[["trajectory", "time", "eps"]])
    return log.assign(deps=rates["deps"].to_numpy())


def rivals(seed: int) -> dict[str, object]:
    muscle = festo_like().muscle
    size = {"rest_length": muscle.rest_length, "rest_diameter": muscle.rest_diameter}
    clip = {"on_unreachable": "clip"}
    return {
        "InverseModel (F, eps)": InverseModel(random_state=seed, **clip),
        "InverseModel (F, eps, rate)": InverseModel(("F", "eps", "deps"), random_state=seed, **clip),
        "InverseModel (F, eps, direction)": InverseModel(direction=True, random_state=seed, **clip),
        "InvertedForce(tondu_lopez)": InvertedForce(GeometricForce("tondu_lopez", **size), **clip),
        "InvertedForce(StaticPIHM)": InvertedForce(StaticPIHM(**size, random_state=seed), **clip),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of sensors and fits (default: 0)")
    parser.add_argument("--images", type=Path, help="folder for the plots")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    train = lifts(LOADS, args.seed)
    slow, fast = lifts(UNSEEN, args.seed + 1), lifts(UNSEEN, args.seed + 2, frequency=0.25, periods=15.0)
    # within a run a set keeps the order of time, so that the direction of the motion is known
    rng = np.random.default_rng(args.seed)
    sets = [np.sort(rng.choice(len(slow), SET, replace=False)) for _ in range(2)]
    full = float(np.ptp(train["P"]))
    print(f"trained on {len(train)} rows under {', '.join(f'{m:g}' for m in LOADS)} kg at 0.05 Hz, 0 to 7 bar;")
    print(f"scored under {', '.join(f'{m:g}' for m in UNSEEN)} kg; errors in % of the range of {full / 1e5:.2f} bar\n")
    print(f"{'':34s} fit / s¹  two sets of {SET}: max       all unseen: max   rms   0.25 Hz, 60 s: max   rms  p99")
    answers: dict[str, np.ndarray] = {}
    for name, model in rivals(args.seed).items():
        started = time.process_time()
        groups = {"groups": train["trajectory"]} if "PIHM" in name else {}
        columns = COLUMNS if hasattr(model, "direction") else [c for c in COLUMNS if c in model.reads]
        model.fit(train[columns], train["P"], **groups)
        seconds = time.process_time() - started
        found = {
            k: (model.predict(log[columns]) - log["P"]).to_numpy() / full * 100 for k, log in (("s", slow), ("f", fast))
        }
        answers[name] = found["f"]
        answers[f"{name}, slow"] = found["s"]
        first, second = (np.abs(found["s"][rows]).max() for rows in sets)
        print(
            f"{name:34s} {seconds:7.1f} {first:16.1f} {second:6.1f} {np.abs(found['s']).max():18.1f} "
            f"{np.sqrt(np.mean(found['s'] ** 2)):5.2f} {np.abs(found['f']).max():20.1f} "
            f"{np.sqrt(np.mean(found['f'] ** 2)):5.2f} {np.quantile(np.abs(found['f']), 0.99):4.1f}",
            flush=True,
        )
    print("\n¹ of one core")
    if args.images is not None:
        draw(args.images, train, slow, fast, sets, answers, full)
    return 0


def draw(
    folder: Path,
    train: pd.DataFrame,
    slow: pd.DataFrame,
    fast: pd.DataFrame,
    sets: list[np.ndarray],
    answers: dict[str, np.ndarray],
    full: float,
) -> None:
    """Draw the data of the training, one unseen set, and a stretch of the long run."""
    best = "InverseModel (F, eps, direction)"
    folder.mkdir(parents=True, exist_ok=True)
    with style():
        figure, axes = new_figure(7.2, 2.9)
        ax = axes[0, 0]
        for load, run in train.groupby("load"):
            ax.plot(
                100 * run["eps"][::8], run["P"][::8] / 1e5, color=BLUE, linewidth=0.8, alpha=0.35 + 0.6 * load / 100
            )
            ax.annotate(f"{load:g} kg", (100 * run["eps"].max(), run["P"].max() / 1e5), fontsize=7, color=INK)
        ax.set_xlabel("contraction / %")
        ax.set_ylabel("pressure / bar")
        ax.set_title("Training: pressure over contraction under six loads, up and down")
        save_figure(figure, folder / "inverse-training.svg")
        figure, axes = new_figure(7.2, 2.6)
        ax = axes[0, 0]
        rows = sets[0]
        measured = slow["P"].to_numpy()[rows] / 1e5
        answer = measured + answers[f"{best}, slow"][rows] / 100 * full / 1e5
        ax.plot(measured, color=GREY, linewidth=1.0, label="measured")
        ax.plot(answer, ".", color=BLUE, markersize=4, label=best)
        ax.set_xlabel(f"sample of a set of {SET}, under loads not trained on")
        ax.set_ylabel("pressure / bar")
        ax.legend(frameon=False, fontsize=8, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
        save_figure(figure, folder / "inverse-unseen.svg")
        figure, axes = new_figure(7.2, 2.6)
        ax = axes[0, 0]
        run = (fast["load"] == UNSEEN[1]).to_numpy() & (fast["time"] < 12.0).to_numpy()
        t, P = fast["time"].to_numpy()[run], fast["P"].to_numpy()[run] / 1e5
        ax.plot(t, P, color=GREY, linewidth=1.6, label="measured")
        for name, colour, dash in ((best, BLUE, "-"), ("InverseModel (F, eps)", INK, ":")):
            ax.plot(t, P + answers[name][run] / 100 * full / 1e5, dash, color=colour, linewidth=0.9, label=name)
        ax.set_xlabel(f"time / s, {UNSEEN[1]:g} kg at 0.25 Hz, five times the frequency of the training")
        ax.set_ylabel("pressure / bar")
        ax.legend(frameon=False, fontsize=8, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
        save_figure(figure, folder / "inverse-long-run.svg")


if __name__ == "__main__":
    sys.exit(main())

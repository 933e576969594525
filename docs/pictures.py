"""Draw the pictures of the pages from what is computed here: ``python docs/pictures.py`` (or the names of some).

Each writes an SVG to docs/images; none is drawn by hand.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pamid import BenchParameters, simulate
from pamid.bench import hold, isobaric, isometric, multisine, sealed_hold, sine, step, triangle, unfold
from pamid.bench.references import Trajectory
from pamid.effects import all_effects
from pamid.gap import Diagnosis, diagnose
from pamid.gap.residuals.bench import Evidence
from pamid.plots.style import BLUE, FAINT, GREY, INK, ORANGE, save_figure, style
from pamid.report.quantities import effect as called

IMAGES = Path(__file__).resolve().parent / "images"
BENCH = BenchParameters.for_muscle("B")


def friction_log() -> pd.DataFrame:
    """Return a log with friction that the simulator does not know of."""
    runs = [multisine(w, 20, 2500, seed=w) for w in (5, 8, 12)] + [triangle(4, 20, 2000), step(0, 12, 1000)]
    return simulate(BENCH, runs, effects=[("coulomb_friction", {"amplitude": 6.0})], seed=0)


# --- the landing page ---------------------------------------------------------------------------------------
def landing() -> Figure:
    """A log and a simulator, where they disagree, which effect is the cause, how far the gap shrinks."""
    with style():
        figure = Figure(figsize=(12, 3.0), layout="constrained")
        _four(figure, figure.subplots(1, 4, width_ratios=[1.05, 1.15, 0.85, 0.75]))
    return figure


def landing_narrow() -> Figure:
    """The same, one below the other, for a phone."""
    with style():
        figure = Figure(figsize=(3.8, 10.4), layout="constrained")
        _four(figure, figure.subplots(4, 1, height_ratios=[1.1, 1.1, 0.9, 0.9]))
    return figure


@cache
def _friction() -> tuple[pd.DataFrame, Diagnosis]:
    log = friction_log()
    return log, diagnose(log, BENCH)


def _four(figure: Figure, axes: np.ndarray) -> None:
    log, found = _friction()
    loop, where, which, how = axes
    _loop(loop, log)
    _map(figure, where, found.windows[found.windows["equation"] == "force"])
    _ranking(which, found)
    _closure(how, next(c for c in found.closure if c.equation == "force"))
    titles = ("1  Log and simulator", "2  Where they disagree", "3  Which effect is the cause", "4  How far it closes")
    for ax, word, colour in zip(axes, titles, (INK, BLUE, BLUE, BLUE), strict=True):
        ax.set_title(word, fontsize=11, fontweight="bold", color=colour, pad=8, x=-0.45 if ax is which else 0)


def _loop(ax: mpl.axes.Axes, log: pd.DataFrame) -> None:
    table = unfold(log, BENCH)
    run = table[(table["muscle"] == 1) & table["trajectory"].str.startswith("triangle")][300:1900:4]
    muscle = BENCH.plant()
    area = np.gradient(muscle.volume(run["eps"].to_numpy()), run["eps"].to_numpy())
    model = (run["P"] - BENCH.gas.atmospheric_pressure) / BENCH.muscle.rest_length * area
    ax.plot(100 * run["eps"], run["F"], color=GREY, linewidth=2.4, label="measured")
    ax.plot(100 * run["eps"], model, color=ORANGE, linewidth=1.2, label="simulator")
    ax.set_xlabel("contraction / %")
    ax.set_ylabel("force / N")
    ax.legend(loc="center", bbox_to_anchor=(0.45, 0.3))


def _map(figure: Figure, ax: mpl.axes.Axes, windows: pd.DataFrame) -> None:
    x, y = 100 * windows["eps"], 100 * windows["deps"]
    inside = (np.abs(y) < 40) & np.isfinite(windows["before"])
    grid, across, up, _ = _mean(x[inside], y[inside], windows["before"][inside])
    ax.set_facecolor("#E4E4E4")
    cells = ax.pcolormesh(across, up, grid.T, cmap="PuOr_r", vmin=-6.5, vmax=6.5, rasterized=True)
    ax.axhline(0, color=INK, linewidth=0.6)
    ax.set_xlabel("contraction / %")
    ax.set_ylabel("rate of contraction / (%/s)")
    figure.colorbar(cells, ax=ax, label="measured − modelled force / N", aspect=14, pad=0.02).outline.set_visible(False)


def _mean(x: pd.Series, y: pd.Series, z: pd.Series) -> tuple[np.ndarray, ...]:
    from scipy.stats import binned_statistic_2d

    grid, across, up, count = binned_statistic_2d(x, y, z, "mean", bins=(20, 14))
    return grid, across, up, count


def _ranking(ax: mpl.axes.Axes, found: object) -> None:
    shown = [c for c in found.candidates if c.effect != "none"][:6][::-1]  # type: ignore[attr-defined]
    named = found.causes[0].effects  # type: ignore[attr-defined]
    bars = ax.barh(
        [called(c.effect) for c in shown],
        [100 * c.confidence for c in shown],
        color=[BLUE if c.effect in named else FAINT for c in shown],
        height=0.62,
    )
    ax.bar_label(bars, fmt="%.0f", padding=3, fontsize=8)
    ax.set_xlim(0, 118)
    ax.set_xlabel("confidence / %")
    ax.tick_params(axis="y", length=0)


def _closure(ax: mpl.axes.Axes, force: object) -> None:
    before, after, noise = force.rmse_before, force.rmse_after, force.noise_floor  # type: ignore[attr-defined]
    bars = ax.bar(["before", "after", "noise"], [before, after, noise], color=[ORANGE, BLUE, FAINT], width=0.62)
    ax.bar_label(bars, fmt="%.2g", padding=2, fontsize=8)
    ax.set_ylabel(f"error on unseen runs / {force.unit}")  # type: ignore[attr-defined]
    ax.set_ylim(0, 1.15 * before)
    ax.tick_params(axis="x", length=0)


# --- a robot ------------------------------------------------------------------------------------------------
def arm() -> Figure:
    """An arm in MuJoCo whose log has friction that the model lacks: page ``simulator-mujoco.md``, run as it stands."""
    import re
    import tempfile
    from contextlib import chdir

    from pamid.gap import diagnose_simulator
    from pamid.signals import read_log
    from pamid.simulators import MujocoSimulator

    page = (IMAGES.parent / "simulator-mujoco.md").read_text(encoding="utf-8")
    model, recorded = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[:2]
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for block in (model, recorded):
            exec(block, {"__name__": "page"})
        columns = {"motor": "torques[0]", "hinge_q": "positions[0]", "hinge_dq": "velocities[0]"}
        log = read_log("run*/*.csv", {"time": {"column": "timestamp", "unit": "us"}, **columns})
        library = ["viscous_friction", "coulomb_friction", "quadratic_drag", "actuator_gain", "sensor_gain"]
        found = diagnose_simulator(log, MujocoSimulator("arm.xml"), library)
    with style():
        figure = Figure(figsize=(11, 3.1), layout="constrained")
        robot, where, which, how = figure.subplots(1, 4, width_ratios=[0.7, 1.15, 0.8, 0.75])
        _swing(robot, log)
        _over_speed(where, found)
        _shares(which, found)
        _closure(how, next(c for c in found.closure if c.equation == "hinge"))
        titles = ("1  Arm, as logged", "2  Where they disagree", "3  Which effects", "4  How far it closes")
        for ax, title in zip((robot, where, which, how), titles, strict=True):
            ax.set_title(title, fontsize=11, fontweight="bold", pad=8, x=-0.45 if ax is which else 0)
    return figure


def _swing(ax: mpl.axes.Axes, log: pd.DataFrame) -> None:
    angles = log.loc[log["trajectory"] == "run0", "hinge_q"].to_numpy()[:160:20]
    for place, angle in enumerate(angles):
        x, z = -0.3 * np.sin(angle), -0.3 * np.cos(angle)
        ax.plot([0, x], [0, z], color=BLUE, linewidth=9, solid_capstyle="round", alpha=0.15 + 0.1 * place)
    ax.plot(0, 0, "o", color=INK, markersize=8)
    ax.set_aspect("equal")
    ax.set_xlim(-0.36, 0.36)
    ax.set_ylim(-0.36, 0.36)
    ax.axis("off")


def _shares(ax: mpl.axes.Axes, found: Diagnosis) -> None:
    causes = found.causes[::-1]
    bars = ax.barh([called(c.effects[0]) for c in causes], [100 * c.share for c in causes], color=BLUE, height=0.5)
    ax.bar_label(bars, fmt="%.0f", padding=3, fontsize=8)
    ax.set_xlim(0, 100)
    ax.set_ylim(-0.8, len(causes) - 0.2)
    ax.set_xlabel("share of the gap / %")
    ax.tick_params(axis="y", length=0)


def _over_speed(ax: mpl.axes.Axes, found: Diagnosis) -> None:
    windows = found.windows[found.windows["equation"] == "hinge"]
    for column, colour, label in (("before", ORANGE, "model as it is"), ("after", BLUE, "corrected")):
        ax.plot(windows["hinge_dq"], windows[column], ".", color=colour, markersize=3, label=label, rasterized=True)
    ax.set_xlabel("joint speed / (rad/s)")
    ax.set_ylabel("measured − modelled torque / N m")
    ax.legend(loc="lower left", markerscale=3)


# --- what to record -----------------------------------------------------------------------------------------
RUNS: dict[str, Callable[[], list[Trajectory]]] = {
    "sine, 1 rad/s": lambda: [sine(1, 15, 2000)],
    "sine, 10 rad/s": lambda: [sine(10, 15, 2000)],
    "triangle, 2 rad/s": lambda: [triangle(2, 20, 2000)],
    "steps": lambda: [step(-10, 12, 1000), step(15, -5, 1000)],
    "multisine to 10 rad/s": lambda: [multisine(10, 15, 2000)],
    "one pressure held": lambda: [isobaric(4, 15, 2000)],
    "joint held": lambda: [isometric(0, 1e5, 2000)],
    "valves shut": lambda: [sealed_hold(10, 2000)],
    "hold": lambda: [hold(10, 2000)],
}


def recording() -> Figure:
    """By how much an effect differs from its nearest rival in two seconds of each kind of run."""
    taken_up = ("inertia", "joint_damping", "valve_conductance")  # by the tolerance of the same number
    names = [
        n
        for n, c in all_effects().items()
        if c.__module__.startswith("pamid.") and c.family not in ("sensor", "geometry") and n not in taken_up
    ]
    names.sort(key=lambda n: (all_effects()[n].equations[0], all_effects()[n].family, n))
    rows = {}
    for label, make in {**RUNS, "all of them": lambda: [t for m in RUNS.values() for t in m()]}.items():
        evidence = Evidence(simulate(BENCH, make(), seed=0), BENCH)
        changes = np.column_stack([evidence.z({n: {}}) - evidence.z0 for n in names])
        rows[label] = [_apart(changes, k, evidence.J) for k in range(len(names))]
    table = pd.DataFrame(rows, index=names).T
    table.loc["all of them"] *= 2.0 / (2.0 * len(RUNS))  # the same two seconds, shared among the kinds
    with style():
        figure = Figure(figsize=(10, 4.4), layout="constrained")
        ax = figure.subplots()
        shown = ax.pcolormesh(
            np.clip(table.to_numpy(), 0.3, 3000), cmap="cividis", norm=mpl.colors.LogNorm(0.3, 3000), edgecolor="white"
        )
        ax.set_yticks(np.arange(len(table)) + 0.5, table.index)
        ax.set_xticks(np.arange(len(names)) + 0.5, [called(n) for n in names], rotation=50, ha="right", fontsize=7)
        ax.tick_params(length=0)
        ax.invert_yaxis()
        ax.axhline(len(RUNS), color="white", linewidth=4)
        ax.set_title("What two seconds of a run tell of an effect of typical size, against the effect most like it")
        bar = figure.colorbar(shown, ax=ax, label="log-likelihood between the two / nat", aspect=24, pad=0.01)
        bar.outline.set_visible(False)
    return figure


def _apart(changes: np.ndarray, k: int, tolerances: np.ndarray) -> float:
    """Return by how much the likeliest other effect, refitted, and the tolerances fall short of an effect."""
    least = np.inf
    for other in [None, *range(changes.shape[1])]:
        if other == k:
            continue
        A = tolerances if other is None else np.column_stack([tolerances, changes[:, other]])
        A = A[:, np.any(A != 0, axis=0)]
        left = changes[:, k] - (A @ np.linalg.lstsq(A, changes[:, k], rcond=None)[0] if A.shape[1] else 0.0)
        least = min(least, 0.5 * float(np.sum(np.minimum(np.square(left), 100.0))))
    return least


def kinds() -> Figure:
    """The kinds of runs: the angle and both pressures."""
    shown = {k: v for k, v in RUNS.items() if k not in ("hold", "sine, 1 rad/s")}
    with style():
        figure = Figure(figsize=(10, 3.6), layout="constrained")
        axes = figure.subplots(2, len(shown), sharey="row", sharex=True)
        for column, (label, make) in enumerate(shown.items()):
            log = simulate(BENCH, make(), seed=0)
            log = log[log["trajectory"] == log["trajectory"].iloc[0]]
            axes[0, column].plot(log["time"], np.degrees(log["q"]), color=INK)
            for muscle, colour in ((1, BLUE), (2, ORANGE)):
                axes[1, column].plot(log["time"], log[f"P{muscle}"] / 1e5, color=colour, label=f"muscle {muscle}")
            axes[0, column].set_title(label)
            axes[1, column].set_xlabel("time / s")
        axes[0, 0].set_ylabel("joint angle / °")
        axes[1, 0].set_ylabel("pressure / bar, absolute")
        axes[1, 0].legend(loc="lower right", fontsize=7)
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {
    "arm": arm,
    "landing": landing,
    "landing-narrow": landing_narrow,
    "recording": recording,
    "runs": kinds,
}


def main() -> int:
    """Draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[], help="which; all by default")
    for name in parser.parse_args().names or PICTURES:
        print(save_figure(PICTURES[name](), IMAGES / f"{name}.svg").name)
    return 0


if __name__ == "__main__":
    sys.exit(main())

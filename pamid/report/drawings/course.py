"""Measured against simulated over the time of a run, without and with the causes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...plots.curves import drawn
from ...plots.style import BLUE, INK, ORANGE, new_figure, style
from ..words import Words
from .windows import chosen_equation, of_trajectory, states, telling_trajectories, unit_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from ...gap.diagnosis.result import Diagnosis


def course_figure(
    d: Diagnosis, equation: str | None = None, trajectory: str | None = None, limits: tuple[float, float] | None = None
) -> Figure:
    """Draw what was measured in a run, and what the simulator says without and with the causes."""
    equation = chosen_equation(d, equation)
    trajectory = trajectory or telling_trajectories(d, equation, 1)[0]
    part = of_trajectory(d, equation, trajectory)
    quantity = Words.of(d).target(equation, unit_of(d, equation))
    time, measured = part["time"].to_numpy(dtype=float), part["measured"].to_numpy(dtype=float)
    with style():
        figure, axes = new_figure(5.2, 2.7)
        ax = axes[0, 0]
        told = {"before": "simulated before" if d.added else "simulated", "after": "simulated after"}
        lines: list[tuple[Any, str, str, Any, float]] = [(measured, INK, "measured", "-", 1.6)]
        for name, colour, dash in zip(states(d), (ORANGE, BLUE), ("-", (0, (4, 2))), strict=False):
            simulated = measured - part[name].to_numpy(dtype=float)
            lines.append((simulated, colour, f"{told[name]}, fit {fit_words(fit(part, name))}", dash, 1.1))
        for values, colour, label, dash, width in lines:
            ax.plot(*drawn(time, quantity.factor * values), color=colour, label=label, linestyle=dash, linewidth=width)
        ax.set_xlabel("time / s")
        ax.set_ylabel(quantity.label)
        if limits is not None:
            ax.set_ylim(*limits)
        handles, labels = ax.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=2)
    return figure


def shared_limits(d: Diagnosis, equation: str, trajectories: list[str]) -> tuple[float, float]:
    """Return the ends of one axis on which several runs find room, in the unit shown."""
    factor = Words.of(d).target(equation, unit_of(d, equation)).factor
    values = []
    for name in trajectories:
        part = of_trajectory(d, equation, name)
        measured = part["measured"].to_numpy(dtype=float)
        values += [measured, *(measured - part[state].to_numpy(dtype=float) for state in states(d))]
    low, high = np.nanquantile(factor * np.concatenate(values), (0.001, 0.999))
    pad = 0.06 * max(float(high - low), 1e-12)
    return float(low - pad), float(high + pad)


def fit(part: pd.DataFrame, name: str) -> float:
    """Return 100 % less the error over the standard deviation of what was measured; NaN where that stands still."""
    spread = float(np.std(part["measured"].to_numpy(dtype=float)))
    error = float(np.sqrt(np.mean(np.square(part[name].to_numpy(dtype=float)))))
    return 100.0 * (1.0 - error / spread) if spread > 0 else float("nan")


def fit_words(value: float) -> str:
    """Return a fit as text; one below zero is worse than the mean and no more is said of it."""
    if not np.isfinite(value):
        return "unknown"
    return f"{value:.1f} %" if value >= 0 else "below 0 %"

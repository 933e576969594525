"""Measured against simulated over the time of a run, without and with the causes."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...gap.diagnosis.result import Diagnosis
from ...plots.curves import drawn
from ...plots.style import BLUE, FAINT, GREY, INK, ORANGE, new_figure, style
from ..words import Words
from .readings import target_rows
from .windows import chosen_equation, of_trajectory, states, telling_trajectories, unit_of

_CLOSE = 100
"""Windows that a panel shows a few pixels apart."""
_SEVERAL = 3
"""Of a run with so many times as many a part is drawn closely."""


def course_figure(
    d: Diagnosis, equation: str | None = None, trajectory: str | None = None, limits: tuple[float, float] | None = None
) -> Figure:
    """Draw measurement and simulator without and with the causes in a run; of a long run, its worst part again."""
    equation = chosen_equation(d, equation)
    trajectory = trajectory or telling_trajectories(d, equation, 1)[0]
    part = of_trajectory(d, equation, trajectory)
    quantity = Words.of(d).target(equation, unit_of(d, equation))
    close, rows = _close(part), target_rows(d, equation, trajectory, str(part["side"].iloc[0]))
    with style():
        figure, axes = new_figure(5.2, 2.7 if close is None else 4.4, 1 if close is None else 2, 1)
        whole = axes[0, 0]
        _draw(whole, d, part, part, quantity.factor, rows)
        if limits is not None:
            whole.set_ylim(*limits)
        if close is not None:
            ends = close["time"].iloc[[0, -1]]
            whole.axvspan(*ends, color=FAINT, alpha=0.6, linewidth=0)
            _draw(axes[1, 0], d, part, close, quantity.factor, rows)
            axes[1, 0].set_title("The grey part")
        for ax in axes[:, 0]:
            ax.set_ylabel(quantity.label)
        axes[-1, 0].set_xlabel("time / s")
        handles, labels = axes[-1, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=2)
    return figure


def _draw(
    ax: Axes, d: Diagnosis, run: pd.DataFrame, part: pd.DataFrame, factor: float, rows: tuple[np.ndarray, ...] | None
) -> None:
    """Draw a part of a run, with the fits of the whole run, over the measured rows if there are any."""
    if rows is not None:
        first, last = part["time"].iloc[[0, -1]]
        time, values = (x[(rows[0] >= first) & (rows[0] <= last)] for x in rows)
        ax.plot(*drawn(time, factor * values), color=GREY, linewidth=0.6, zorder=1.5, label="measured, every row")
    time, measured = part["time"].to_numpy(dtype=float), part["measured"].to_numpy(dtype=float)
    told = {"before": "simulated before" if d.added else "simulated", "after": "simulated after"}
    lines: list[tuple[Any, str, str, Any, float]] = [(measured, INK, "measured", "-", 1.6)]
    for name, colour, dash in zip(states(d), (ORANGE, BLUE), ("-", (0, (4, 2))), strict=False):
        simulated = measured - part[name].to_numpy(dtype=float)
        lines.append((simulated, colour, f"{told[name]}, fit {fit_words(fit(run, name))}", dash, 1.1))
    for values, colour, label, dash, width in lines:
        ax.plot(*drawn(time, factor * values), color=colour, label=label, linestyle=dash, linewidth=width)


def _close(part: pd.DataFrame) -> pd.DataFrame | None:
    """Return the part of a run with the largest error; None where all of the run is legible."""
    if len(part) < _SEVERAL * _CLOSE:
        return None
    before = np.concatenate([[0.0], np.cumsum(np.square(part["before"].to_numpy(dtype=float)))])
    first = int(np.argmax(before[_CLOSE:] - before[:-_CLOSE]))
    return part.iloc[first : first + _CLOSE]


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
    """Return 100 % less the error over the standard deviation of the measurements; NaN where these are constant."""
    spread = float(np.std(part["measured"].to_numpy(dtype=float)))
    error = float(np.sqrt(np.mean(np.square(part[name].to_numpy(dtype=float)))))
    return 100.0 * (1.0 - error / spread) if spread > 0 else float("nan")


def fit_words(value: float) -> str:
    """Return a fit as text; one below zero is worse than the mean and no more is said of it."""
    if not np.isfinite(value):
        return "unknown"
    return f"{value:.1f} %" if value >= 0 else "below 0 %"

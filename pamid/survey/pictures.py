"""Pictures of a log: what it covers, its first run, how fast it moves."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..plots.curves import drawn
from ..plots.style import BLUE, GREY, ORANGE, new_figure, style
from ..report.words import BENCH
from ..signals.thinning import spaced
from .coverage import Coverage, smoothed

_MOST_POINTS = 4000


def coverage_picture(log: pd.DataFrame, c: Coverage) -> Figure:
    """Draw pressure (or the target) against position, one colour a direction of time's order."""
    across = c.position or "time"
    up = c.pressure or c.target or next(str(n) for n in log.columns if n not in ("trajectory", "time"))
    part = log[[across, up]].dropna().iloc[spaced(len(log), _MOST_POINTS)]
    x, y = BENCH.signal(across), BENCH.signal(up)
    with style():
        figure, axes = new_figure(4.6, 3.2)
        ax = axes[0, 0]
        ax.plot(part[across] * x.factor, part[up] * y.factor, ".", markersize=1.5, color=BLUE, alpha=0.5)
        ax.set(xlabel=x.label, ylabel=y.label)
    return figure


def run_picture(log: pd.DataFrame, c: Coverage) -> Figure:
    """Draw the longest run over time: the moving and the measured signals."""
    sizes = log.groupby("trajectory", sort=False).size()
    run = log[log["trajectory"] == sizes.idxmax()]
    names = [n for n in dict.fromkeys((c.position, c.pressure, c.target)) if n] or [str(log.columns[-1])]
    time = (run["time"] - run["time"].iloc[0]).to_numpy(dtype=float)
    with style():
        figure, axes = new_figure(4.6, 0.8 + 1.1 * len(names), len(names), 1, sharex=True)
        for ax, name in zip(axes[:, 0], names, strict=True):
            q = BENCH.signal(name)
            ax.plot(*drawn(time, q.factor * run[name].to_numpy(dtype=float)), color=BLUE, linewidth=0.9)
            ax.set_ylabel(f"{name} / {q.unit}" if q.unit else name)
        axes[-1, 0].set_xlabel("time / s")
    return figure


def speed_picture(log: pd.DataFrame, c: Coverage) -> Figure | None:
    """Draw how often which speed occurs, both ways; None where nothing moves."""
    if not c.position or not c.fast > 0:
        return None
    rates = [one.rate for one in smoothed(log, c.position)]
    if not rates:
        return None
    q = BENCH.signal(c.position)
    rate = np.concatenate(rates) * q.factor
    edge = float(np.quantile(np.abs(rate), 0.995))
    bins = np.linspace(-edge, edge, 41)
    with style():
        figure, axes = new_figure(4.6, 2.6)
        ax = axes[0, 0]
        share, _ = np.histogram(np.clip(rate, -edge, edge), bins=bins)
        colours = [ORANGE if b < 0 else BLUE for b in 0.5 * (bins[1:] + bins[:-1])]
        ax.bar(0.5 * (bins[1:] + bins[:-1]), 100 * share / len(rate), width=np.diff(bins), color=colours)
        ax.axvline(0.0, color=GREY, linewidth=0.7)
        ax.set(
            xlabel=f"rate of {q.words.replace(', absolute', '')} / {f'{q.unit}/s' if q.unit else '1/s'}",
            ylabel="share of the time / %",
        )
    return figure

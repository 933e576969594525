"""Errors of estimators side by side."""

import math
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from .style import BLUE, FAINT, GREY, NAMES, SHOWN, checked_ending, new_figure, save_figure, style


def comparison_plot(comparison: Any, path: str | Path | None = None, *, title: str = "") -> Figure:
    """Draw the held-out error of each estimator as a dot with its interval, the best on top.

    Parameters
    ----------
    comparison : Comparison
        What `pamid.compare.compare` returned.
    path : path-like, optional
        PNG or SVG to write.
    title : str, default=""
        First words of the title, such as the name of the log.

    Returns
    -------
    Figure
        The figure.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine, unfold
    >>> from pamid.compare import compare
    >>> bench = BenchParameters.for_muscle("B")
    >>> table = unfold(simulate(bench, [sine(w, 10.0, 400) for w in (2.0, 4.0, 8.0)]), bench)
    >>> result = compare(table, "force", ["PolynomialForce", "GeometricForce(chou_hannaford)"], cv=3)
    >>> from pamid.plots import comparison_plot
    >>> figure = comparison_plot(result)
    """
    if path is not None:
        path = checked_ending(path)
    from matplotlib.ticker import LogLocator, NullFormatter

    factor, unit = SHOWN.get(comparison.unit, (1.0, comparison.unit))
    scores = [s for s in comparison.scores if not s.error]
    values = [s.rmse * factor for s in scores]
    floor = comparison.noise_floor * factor
    with style():
        figure, axes = new_figure(7.2, 1.3 + 0.27 * len(scores))
        ax = axes[0, 0]
        for place, score in enumerate(scores):
            colour = GREY if score.differs else BLUE
            low, high = score.rmse_low * factor, score.rmse_high * factor
            ax.axhline(place, color=FAINT, linewidth=0.5, zorder=0)
            ax.plot([low, high], [place, place], color=colour, linewidth=2.2, solid_capstyle="butt", alpha=0.55)
            ax.plot([score.rmse * factor], [place], "o", color=colour, markersize=5)
            ax.annotate(
                f"{score.rmse * factor:.3g}",
                (1.0, place),
                xycoords=("axes fraction", "data"),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
            )
        wide = max(values) > 8 * min(v for v in values if v > 0) if any(v > 0 for v in values) else False
        if wide:
            ax.set_xscale("log")
            few = max(values) < 300 * min(v for v in values if v > 0)
            ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=12))
            ax.xaxis.set_major_formatter("{x:g}")
            ax.xaxis.set_minor_formatter(NullFormatter())
        else:
            ax.set_xlim(left=0.0)
        if math.isfinite(floor) and floor > 0:
            ax.axvline(floor, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
            ax.annotate(
                "noise floor",
                (floor, 0.0),
                xycoords=("data", "axes fraction"),
                xytext=(3, 4),
                textcoords="offset points",
                color=GREY,
                fontsize=8,
            )
        ax.set_yticks(range(len(scores)), [s.estimator for s in scores])
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(False)
        ax.set_ylim(len(scores) - 0.4, -0.6)
        name = NAMES.get(comparison.equation, comparison.equation)
        ax.set_xlabel(f"held-out RMSE of the {name} / {unit}, with its 90 % interval over runs")
        head = f"{title}: " if title else ""
        ax.set_title(
            f"{head}{comparison.n_runs} runs, {comparison.n_folds} folds; blue: no different from the best", pad=10
        )
        if path is not None:
            save_figure(figure, path)
    return figure

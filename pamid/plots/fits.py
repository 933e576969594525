"""Held-out predictions against measurements, over time and as loops."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..explained import explained_by
from ..names import require_one_of
from .comparison import comparison_plot
from .style import BLUE, FAINT, NAMES, SHOWN, checked_ending, new_figure, save_figure, style

_STILL = 2e-3  # range of contraction below which a run is taken for isometric


@explained_by(comparison_plot)
def fit_plot(
    comparison: Any, estimator: str | None = None, path: str | Path | None = None, *, title: str = ""
) -> Figure:
    """Draw an estimator's predictions of the best, the median and the worst held-out run.

    The upper panels show them over time, the lower ones as loops over the contraction, or over the pressure where the
    contraction is held.

    Parameters
    ----------
    estimator : str, optional
        Label of the estimator; the best by default.

    Returns
    -------
    Figure
        The figure.

    Raises
    ------
    UnknownOptionError
        If no such estimator was compared.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine, unfold
    >>> from pamid.compare import compare
    >>> bench = BenchParameters.for_muscle("B")
    >>> table = unfold(simulate(bench, [sine(w, 10.0, 400) for w in (2.0, 4.0, 8.0)]), bench)
    >>> result = compare(table, "force", ["PolynomialForce", "GeometricForce(chou_hannaford)"], cv=3)
    >>> from pamid.plots import fit_plot
    >>> figure = fit_plot(result)
    """
    if path is not None:
        path = checked_ending(path)
    label = estimator or comparison.best.estimator
    require_one_of(label, comparison.predictions, f"There is no prediction of {label!r}.")
    factor, unit = SHOWN[comparison.unit]
    rows = comparison.rows.assign(predicted=comparison.predictions[label])
    chosen = _examples(rows)
    name = NAMES[comparison.equation]
    with style():
        figure, axes = new_figure(8.6, 5.2, 2, len(chosen), sharey="col")
        for column, (word, trajectory) in enumerate(chosen.items()):
            part = rows[rows["trajectory"] == trajectory]
            error = factor * float(np.sqrt(np.mean((part["predicted"] - part["measured"]) ** 2)))
            part = _broken_at_gaps(part)
            measured, predicted = part["measured"] * factor, part["predicted"] * factor
            top, below = axes[0, column], axes[1, column]
            across, text = _across(part)
            for ax, x in ((top, part["time"]), (below, across)):
                ax.plot(x, measured, color=FAINT, linewidth=3.2, label="measured")
                ax.plot(x, predicted, color=BLUE, linewidth=1.0, label="predicted")
            top.set_title(f"{word}: RMSE {error:.3g} {unit}\n{_short(trajectory)}")
            top.set_xlabel("time / s")
            below.set_xlabel(text)
            if column == 0:
                top.set_ylabel(f"{name} / {unit}")
                below.set_ylabel(f"{name} / {unit}")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=2)
        head = f"{title}: " if title else ""
        figure.suptitle(f"{head}{label} on runs unseen by its fit", x=0.01, ha="left", fontsize=10)
        if path is not None:
            save_figure(figure, path)
    return figure


def _examples(rows: pd.DataFrame) -> dict[str, str]:
    """Choose the best, the median and the worst run by root mean square error."""
    square = (rows["predicted"] - rows["measured"]) ** 2
    order = square.groupby(rows["trajectory"], sort=False).mean().sort_values(kind="stable").index
    places = {"best": 0, "median": len(order) // 2, "worst": len(order) - 1}
    chosen: dict[str, str] = {}
    for word, place in places.items():
        if order[place] not in chosen.values():
            chosen[word] = order[place]
    return chosen


def _broken_at_gaps(part: pd.DataFrame) -> pd.DataFrame:
    """Break the lines where rows are left out, so that nothing is drawn where nothing was scored."""
    steps = np.diff(part["time"].to_numpy(dtype=float))
    if not len(steps):
        return part
    shown = part[["time", "eps", "P", "measured", "predicted"]].reset_index(drop=True)
    after = np.flatnonzero(steps > 5 * np.median(steps))
    shown.index = shown.index.astype(float)
    return shown.reindex(np.sort(np.concatenate([shown.index.to_numpy(), after + 0.5])))


def _short(name: str, most: int = 30) -> str:
    return name if len(name) <= most else f"{name[: most // 2 - 1]}…{name[-most // 2 :]}"


def _across(part: pd.DataFrame) -> tuple[pd.Series, str]:
    if np.ptp(part["eps"].dropna().to_numpy()) > _STILL:
        return 100 * part["eps"], "contraction / %"
    return part["P"] / 1e5, "pressure / bar, absolute"

"""Measured and predicted loops of single runs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ..errors import UnknownOptionError
from ..explained import explained_fields
from ..signals.splits import trajectories_of
from ._display import Display
from ._signals import axis_of, column, predicted, same_length, target_of
from .style import BLUE, GREEN, GREY, ORANGE, PURPLE, drawn_on, style

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE)


@explained_fields
@dataclass(eq=False, repr=False)
class LoopDisplay(Display):
    """Target over the contraction (or another signal), run by run, measured and predicted.

    The width of a loop is what a static model cannot follow: hysteresis, friction, lags.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import GeometricForce
    >>> from pamid.plots import LoopDisplay
    >>> t = np.linspace(0, 6, 300)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.08 * np.sin(t), "P": 3e5 + 1e5 * np.cos(2 * t)})
    >>> F = 1e-3 * (X["P"] - 101325) * (1 - 3 * X["eps"])
    >>> display = LoopDisplay.from_estimator(GeometricForce().fit(X, F), X, F, groups=np.repeat("sine", 300))
    >>> display.plot().ax_.get_ylabel()
    'force / N'
    """

    x: Annotated[np.ndarray, "Signal on the axis, SI; shape (n_samples,)."]
    y_true: Annotated[np.ndarray, "Measured and predicted target, SI; shape (n_samples,)."]
    y_pred: Annotated[np.ndarray, "Measured and predicted target, SI; shape (n_samples,)."]
    groups: Annotated[np.ndarray, "Run of each sample; shape (n_samples,)."]
    across: Annotated[str, "What x is: a column's name."] = "eps"
    unit: Annotated[str, "SI unit of the target."] = "N"

    def __post_init__(self) -> None:
        same_length(x=self.x, y_true=self.y_true, y_pred=self.y_pred, groups=self.groups)

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: pd.DataFrame, y: Any, *, groups: Any = None, across: str = "eps", unit: str = "N"
    ) -> Self:
        """Predict with a fitted estimator.

        Parameters
        ----------
        X : DataFrame
            Signals, with the column `across`.

        Raises
        ------
        MissingColumnError, MissingTrajectoryError, ShapeError
            The table lacks the column, nothing names the runs, or lengths differ.
        """
        return cls.from_predictions(y, predicted(estimator, X), X, groups=groups, across=across, unit=unit)

    @classmethod
    def from_predictions(
        cls, y_true: Any, y_pred: Any, X: pd.DataFrame, *, groups: Any = None, across: str = "eps", unit: str = "N"
    ) -> Self:
        """Take predictions as they are.

        Parameters
        ----------
        X : DataFrame
            Signals, with the column `across`.
        """
        y_true, y_pred = (np.asarray(y, dtype=float).ravel() for y in (y_true, y_pred))
        return cls(column(X, across), y_true, y_pred, trajectories_of(X, groups, needed_by="The picture"), across, unit)

    def plot(self, ax: Axes | None = None, *, runs: Sequence[Any] | None = None, most: int = 3) -> Self:
        """Draw some runs.

        Parameters
        ----------
        runs : sequence, optional
            Which runs; by default `most` of them, evenly from the best to the worst predicted.
        most : int, default=3
            How many runs where none are named.

        Raises
        ------
        UnknownOptionError
            If there is no such run.
        """
        names = list(dict.fromkeys(self.groups.tolist()))
        if runs is not None and (strange := [r for r in runs if r not in names]):
            raise UnknownOptionError(
                f"There is no run {strange[0]!r}.", f"one of {', '.join(map(str, names[:12]))}", "Correct it."
            )
        chosen = list(runs) if runs is not None else self._examples(names, most)
        factor, word, unit = target_of(self.unit)
        scale, label = axis_of(self.across)
        with style():
            self.figure_, self.ax_ = drawn_on(ax)
            for k, name in enumerate(chosen):
                rows = self.groups == name
                colour = _COLOURS[k % len(_COLOURS)]
                x = scale * self.x[rows]
                self.ax_.plot(x, factor * self.y_true[rows], color=colour, linewidth=3.0, alpha=0.28)
                self.ax_.plot(x, factor * self.y_pred[rows], color=colour, linewidth=1.0, label=str(name)[:30])
            self.ax_.plot([], [], color=GREY, linewidth=3.0, alpha=0.4, label="wide: measured")
            self.ax_.set(xlabel=label, ylabel=f"{word} / {unit}")
            self.ax_.legend()
        return self

    def _examples(self, names: list[Any], most: int) -> list[Any]:
        error = [float(np.nanmean(np.square((self.y_true - self.y_pred)[self.groups == n]))) for n in names]
        order = np.argsort(error, kind="stable")
        picked = np.unique(np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int))
        return [names[order[k]] for k in picked]

"""Where over the state a model errs, and which way."""

from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ..errors import ParameterError
from ..explained import explained_fields
from ._display import Display
from ._signals import axis_of, column, predicted, same_length, target_of
from .style import drawn_on, style

_BACK = "#E4E4E4"  # where there are no data
_FEWEST = 3  # samples in a cell that is drawn


@explained_fields
@dataclass(eq=False, repr=False)
class ResidualMapDisplay(Display):
    """Mean of measured less predicted over two signals of the state.

    See Also
    --------
    pamid.report.GapDisplay : The same of a diagnosis, before and after its causes.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.plots import ResidualMapDisplay
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.2, 999), "P": rng.uniform(2e5, 6e5, 999)})
    >>> display = ResidualMapDisplay.from_predictions(40 * X["eps"], np.zeros(999), X)
    >>> display.residual.shape, bool(np.nanmean(display.residual[:, -1]) > np.nanmean(display.residual[:, 0]))
    ((14, 18), True)
    """

    edges_x: Annotated[np.ndarray, "Edges of the cells, SI."]
    edges_y: Annotated[np.ndarray, "Edges of the cells, SI."]
    residual: Annotated[
        np.ndarray, "Mean residual of each cell, SI; NaN where there are too few samples; shape (n_y, n_x)."
    ]
    over: Annotated[tuple[str, str], "The two columns."]
    unit: Annotated[str, "SI unit of the target."] = "N"

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: pd.DataFrame,
        y: Any,
        *,
        over: tuple[str, str] = ("eps", "P"),
        unit: str = "N",
        cells: tuple[int, int] = (18, 14),
    ) -> Self:
        """Predict with a fitted estimator.

        Parameters
        ----------
        X : DataFrame
            Signals, with the columns of `over`.

        Raises
        ------
        MissingColumnError, ShapeError, ParameterError
            A column is missing, lengths differ, or there are fewer than two cells.
        """
        return cls.from_predictions(y, predicted(estimator, X), X, over=over, unit=unit, cells=cells)

    @classmethod
    def from_predictions(
        cls,
        y_true: Any,
        y_pred: Any,
        X: pd.DataFrame,
        *,
        over: tuple[str, str] = ("eps", "P"),
        unit: str = "N",
        cells: tuple[int, int] = (18, 14),
    ) -> Self:
        """Take predictions as they are.

        Parameters
        ----------
        X : DataFrame
            Signals, with the columns of `over`.
        """
        if min(cells) < 2:
            raise ParameterError(f"cells is {cells}.", "at least 2 along each axis", "Raise it.")
        x, y = column(X, over[0]), column(X, over[1])
        error = np.asarray(y_true, dtype=float).ravel() - np.asarray(y_pred, dtype=float).ravel()
        same_length(X=x, y_true=error)
        good = np.isfinite(x) & np.isfinite(y) & np.isfinite(error)
        edges = [_edges(v[good], n) for v, n in zip((x, y), cells, strict=True)]
        count = np.histogram2d(x[good], y[good], bins=edges)[0]
        total = np.histogram2d(x[good], y[good], bins=edges, weights=error[good])[0]
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.where(count >= _FEWEST, total / count, np.nan)
        return cls(edges[0], edges[1], mean.T, over, unit)

    def plot(self, ax: Axes | None = None) -> Self:
        """Draw the map; white agrees, grey has no data."""
        factor, word, unit = target_of(self.unit)
        (sx, lx), (sy, ly) = axis_of(self.over[0]), axis_of(self.over[1])
        shown = factor * self.residual
        known = np.abs(shown[np.isfinite(shown)])
        top = float(np.quantile(known, 0.98)) if known.size else 1.0
        with style():
            self.figure_, self.ax_ = drawn_on(ax)
            self.ax_.set_facecolor(_BACK)
            mesh = self.ax_.pcolormesh(
                sx * self.edges_x, sy * self.edges_y, shown, cmap="PuOr_r", vmin=-top or -1.0, vmax=top or 1.0
            )
            self.figure_.colorbar(mesh, ax=self.ax_, label=f"{word}, measured less predicted / {unit}", extend="both")
            self.ax_.set(xlabel=lx, ylabel=ly)
        return self


def _edges(values: np.ndarray, n: int) -> np.ndarray:
    low, high = (float(np.quantile(values, q)) for q in (0.002, 0.998)) if len(values) else (0.0, 1.0)
    if high <= low:
        low, high = low - 0.5 * max(abs(low), 1e-9), high + 0.5 * max(abs(low), 1e-9)
    return np.linspace(low, high, n + 1)

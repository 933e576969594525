"""Whether a residual is white and unrelated to inputs, as a picture."""

from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..compare.whiteness import ResidualTest, residual_test
from ..explained import explained_fields
from .style import BLUE, FAINT, GREY, ORANGE, new_figure, style


@explained_fields
@dataclass(eq=False, repr=False)
class ResidualTestDisplay:
    """Autocorrelation of a residual, and its correlation with each input, with their bands.

    What leaves a band is orange: before lag 0 it is feedback to that input, from lag 0 on an influence that the model
    lacks.

    Attributes
    ----------
    figure_ : Figure
        What was drawn.
    axes_ : list of Axes
        Its axes: the autocorrelation, then one per input.

    See Also
    --------
    ResidualMapDisplay : Where over the state a model errs.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.plots import ResidualTestDisplay
    >>> rng = np.random.default_rng(0)
    >>> display = ResidualTestDisplay.from_predictions(rng.standard_normal(900), np.zeros(900), {"u": np.arange(900.0)})
    >>> len(display.plot().axes_)
    2
    """

    test: Annotated[ResidualTest, "What `pamid.compare.residual_test` found."]

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: pd.DataFrame, y: Any, *, groups: Any = None, lags: int = 25, interval: float = 1.0
    ) -> Self:
        """Predict a log, and test what is left against every column that the estimator reads.

        Parameters
        ----------
        estimator : estimator
            A fitted one.
        X : DataFrame
            What it reads, in time order within each run.
        y : array_like, shape (n_samples,)
            Measured target.
        groups : array_like, shape (n_samples,), optional
            Run of each row; a column ``trajectory`` serves too.
        lags : int, default=25
            Largest lag, rows.
        interval : float, default=1.0
            Time between rows, s.

        Returns
        -------
        ResidualTestDisplay
            To be drawn with ``plot``.
        """
        inputs = {str(c): X[c] for c in X.columns if c not in ("trajectory", "run", "time")}
        if groups is None and "trajectory" in X.columns:
            groups = X["trajectory"].to_numpy()
        return cls.from_predictions(y, estimator.predict(X), inputs, groups=groups, lags=lags, interval=interval)

    @classmethod
    def from_predictions(
        cls, y: Any, predicted: Any, inputs: Any, *, groups: Any = None, lags: int = 25, interval: float = 1.0
    ) -> Self:
        """Test what predictions leave, with signals that may explain it as a mapping or DataFrame.

        The other parameters are those of `from_estimator`.
        """
        error = np.asarray(y, dtype=float) - np.asarray(predicted, dtype=float)
        return cls(residual_test(error, dict(inputs), groups, lags=lags, interval=interval))

    def plot(self) -> Self:
        """Draw in a new figure; return itself, with the attributes ``figure_`` and ``axes_``."""
        test, names = self.test, list(self.test.cross)
        with style():
            self.figure_: Figure
            self.figure_, axes = new_figure(5.2, 1.5 * (1 + len(names)) + 0.5, 1 + len(names), 1)
            self.axes_ = list(axes[:, 0])
            self._stems(self.axes_[0], test.lags[1:], test.auto[1:], test.auto_band, "residual with its past")
            for ax, name in zip(self.axes_[1:], names, strict=True):
                self._stems(ax, test.cross_lags, test.cross[name], test.cross_band[name], f"residual with {name}")
                ax.axvline(0.0, color=GREY, linewidth=0.7)
            self.axes_[-1].set_xlabel("lag / rows" if test.interval == 1.0 else "lag / s")
            self.axes_[0].set_title(f"grey: {100 * test.level:g} % of chance; orange: beyond it")
        return self

    def _stems(self, ax: Any, lags: np.ndarray, values: np.ndarray, band: float, name: str) -> None:
        x = lags * self.test.interval
        ax.axhspan(-band, band, color=FAINT, alpha=0.6, linewidth=0)
        colours = [ORANGE if abs(v) > band else BLUE for v in values]
        ax.vlines(x, 0.0, values, colors=colours, linewidth=1.4)
        ax.scatter(x, values, c=colours, s=7, zorder=3)
        ax.axhline(0.0, color=GREY, linewidth=0.7)
        ax.set_ylabel(f"{name}\n(correlation)", fontsize=8)
        top = 1.15 * max(2.0 * band, float(np.max(np.abs(values), initial=0.0)))
        ax.set_ylim(-top, top)

"""How the error falls with the samples of an adaptation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ..errors import ParameterError, ShapeError
from ..explained import explained_fields
from ..signals.splits import trajectories_of
from ._display import Display
from ._signals import predicted, target_of
from .style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, drawn_on, style

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY)
_MARKS = ("o", "s", "^", "D", "v")


@explained_fields
@dataclass(eq=False, repr=False)
class AdaptationDisplay(Display):
    """Error on unseen runs over the number of samples that an adaptation had, one curve per method.

    Examples
    --------
    >>> from pamid.plots import AdaptationDisplay
    >>> display = AdaptationDisplay.from_predictions([50, 200, 800], {"q": [3.0, 2.0, 1.8]}, before=9.0)
    >>> display.plot().ax_.get_xlabel()
    'samples of the target'
    """

    samples: Annotated[np.ndarray, "Numbers of samples; shape (n_sizes,)."]
    errors: Annotated[
        Mapping[str, np.ndarray],
        "Root mean square error of each method, SI; several draws give a band from the least to the largest; shape "
        "(n_sizes,) or (n_sizes, n_draws).",
    ]
    before: Annotated[float | None, "Error of the source as it is."] = None
    unit: Annotated[str, "SI unit of the errors."] = "N"

    def __post_init__(self) -> None:
        for name, values in self.errors.items():
            if len(values) != len(self.samples):
                raise ShapeError(
                    f"{name} has {len(values)} errors for {len(self.samples)} numbers of samples.",
                    "one per size",
                    "Correct it.",
                )

    @classmethod
    def from_predictions(
        cls, samples: Any, errors: Mapping[str, Any], *, before: float | None = None, unit: str = "N"
    ) -> Self:
        """Take errors as they are.

        Parameters
        ----------
        samples : array_like, shape (n_sizes,)
            Numbers of samples.
        errors : mapping of str to array_like, shape (n_sizes,) or (n_sizes, n_draws)
            Root mean square errors by method, SI.
        before : float, optional
            Error of the source as it is.
        """
        arrays = {str(name): np.asarray(values, dtype=float) for name, values in errors.items()}
        return cls(np.asarray(samples, dtype=int), arrays, before, unit)

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: pd.DataFrame,
        y: Any,
        X_test: pd.DataFrame,
        y_test: Any,
        *,
        groups: Any = None,
        samples: Sequence[int] = (50, 100, 200, 400),
        n_draws: int = 3,
        source: Any = None,
        unit: str = "N",
        random_state: Any = None,
    ) -> Self:
        """Fit clones of an adapter, or of several, on parts of the target's data, and score them on unseen runs.

        Parameters
        ----------
        estimator : estimator or mapping of str to estimator
            Adapters, such as ``QAdapter(FrozenEstimator(source))``; they stay as they are.
        X : DataFrame
            Signals of the target to adapt on.
        y : array_like, shape (n_samples,)
            Target of the fit, SI.
        X_test : DataFrame
            Signals of runs that are kept for the score.
        y_test : array_like, shape (n_test_samples,)
            Target on them, SI.
        samples : sequence of int, default=(50, 100, 200, 400)
            Numbers of samples.
        n_draws : int, default=3
            Draws of samples at each number.
        source : estimator, optional
            Fitted model of the source, for the line "as it is".
        random_state : int, RandomState or None, default=None
            Draws.

        Raises
        ------
        ParameterError
            More samples are asked for than there are.
        MissingTrajectoryError
            Nothing names the runs.
        """
        from sklearn.base import clone
        from sklearn.utils import check_random_state

        methods = estimator if isinstance(estimator, Mapping) else {type(estimator).__name__: estimator}
        if max(samples) > len(X):
            raise ParameterError(
                f"{max(samples)} samples are asked for; X has {len(X)}.", "at most as many", "Lower it."
            )
        runs = trajectories_of(X, groups, needed_by="The picture")
        y, y_test = np.asarray(y, dtype=float), np.asarray(y_test, dtype=float)
        draws = check_random_state(random_state)
        errors: dict[str, Any] = {name: np.full((len(samples), n_draws), np.nan) for name in methods}
        for k, n in enumerate(samples):
            for j in range(n_draws):
                rows = np.sort(draws.choice(len(X), n, replace=False))
                for name, method in methods.items():
                    model = clone(method).fit(X.iloc[rows].reset_index(drop=True), y[rows], groups=runs[rows])
                    errors[name][k, j] = _rmse(y_test, predicted(model, X_test))
        before = None if source is None else _rmse(y_test, predicted(source, X_test))
        return cls(np.asarray(samples, dtype=int), errors, before, unit)

    def plot(self, ax: Axes | None = None) -> Self:
        """Draw the curves, both axes in powers of ten."""
        factor, word, unit = target_of(self.unit)
        with style():
            self.figure_, self.ax_ = drawn_on(ax)
            for k, (name, values) in enumerate(self.errors.items()):
                every = factor * values.reshape(len(self.samples), -1)
                colour = _COLOURS[k % len(_COLOURS)]
                if every.shape[1] > 1:
                    self.ax_.fill_between(
                        self.samples, every.min(axis=1), every.max(axis=1), color=colour, alpha=0.18, lw=0
                    )
                mark = _MARKS[k % len(_MARKS)]
                self.ax_.plot(
                    self.samples, np.median(every, axis=1), color=colour, marker=mark, markersize=4, label=name
                )
            if self.before is not None:
                self.ax_.axhline(factor * self.before, color=GREY, linestyle=(0, (4, 3)), label="source as it is")
            self.ax_.set(xscale="log", yscale="log", xlabel="samples of the target")
            self.ax_.set_ylabel(f"error of the {word} on unseen runs, RMSE / {unit}")
            _plain_ticks(self.ax_, self.samples)
            self.ax_.legend()
        return self


def _plain_ticks(ax: Axes, samples: np.ndarray) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.set_xticks(samples, [f"{n:,}" for n in samples])
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _rmse(y: np.ndarray, predicted_: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(y - predicted_))))

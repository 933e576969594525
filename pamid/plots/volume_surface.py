"""The gas volume over contraction and pressure, with how far it is known."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ..constants import ATMOSPHERIC_PRESSURE
from ..errors import ParameterError
from ..explained import explained_fields
from ..signals.splits import trajectories_of
from ..signals.thinning import spaced
from ._display import Display
from ._signals import column, resting, with_volume
from .style import INK, drawn_on, style

_FAR = 0.08  # of the range: beyond it from every sample the surface is drawn pale


@explained_fields
@dataclass(eq=False, repr=False)
class VolumeSurfaceDisplay(Display):
    """Identified volume over contraction and gauge pressure, and its relative uncertainty as lines.

    The uncertainty is the spread of the volume among estimators that were fitted on different runs: what other runs
    would have given. It says nothing about errors that all of them share, such as a wrong diameter.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import GeometricForce
    >>> from pamid.plots import VolumeSurfaceDisplay
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.2, 200), "P": rng.uniform(2e5, 6e5, 200)})
    >>> F = 1e-3 * (X["P"] - 101325) * (1 - 3 * X["eps"]) + rng.standard_normal(200)
    >>> runs = np.repeat(["a", "b", "c", "d"], 50)
    >>> display = VolumeSurfaceDisplay.from_estimator(GeometricForce(), X, F, groups=runs, n_refits=3, random_state=0)
    >>> display.V.shape, bool((display.V_std > 0).any())
    ((40, 40), True)
    """

    eps: Annotated[np.ndarray, "Contraction ratio, dimensionless; shape (n_eps,)."]
    p_gauge: Annotated[np.ndarray, "Gauge pressure, Pa; shape (n_pressures,)."]
    V: Annotated[np.ndarray, "Volume and its standard deviation, m³; shape (n_pressures, n_eps)."]
    V_std: Annotated[np.ndarray, "Volume and its standard deviation, m³; shape (n_pressures, n_eps)."]
    known: Annotated[np.ndarray, "Where there were samples nearby; shape (n_pressures, n_eps)."]

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: pd.DataFrame,
        y: Any,
        *,
        groups: Any = None,
        n_refits: int = 8,
        random_state: Any = None,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        n_points: int = 40,
    ) -> Self:
        """Refit clones of an estimator on runs drawn with replacement.

        Parameters
        ----------
        estimator : estimator
            With a method ``volume(X)`` once fitted; it stays as it is.
        X : DataFrame
            Signals, with ``eps`` and ``P`` (Pa, absolute).
        y : array_like, shape (n_samples,)
            Target of the fit.
        n_refits : int, default=8
            Refits.
        random_state : int, RandomState or None, default=None
            Draws of runs.

        Raises
        ------
        ParameterError
            Fewer than two refits, or a single run.
        IncompatibleError
            The estimator identifies no volume.
        MissingTrajectoryError
            Nothing names the runs.
        """
        from sklearn.base import clone
        from sklearn.utils import check_random_state
        from sklearn.utils.validation import has_fit_parameter

        runs = trajectories_of(X, groups, needed_by="The spread over runs")
        names = np.unique(runs)
        if n_refits < 2 or len(names) < 2:
            raise ParameterError(
                f"There are {len(names)} runs and {n_refits} refits.", "two of each at least", "Pass more runs."
            )
        draws, y = check_random_state(random_state), np.asarray(y, dtype=float)
        fitted = []
        for _ in range(n_refits):
            drawn = draws.choice(len(names), len(names))
            if len(set(drawn.tolist())) == 1:  # one run alone would not be a sample of them
                drawn[0] = (drawn[0] + 1) % len(names)
            rows = np.concatenate([np.flatnonzero(runs == names[k]) for k in drawn])
            copies = np.concatenate(
                [np.repeat(f"{c}-{names[k]}", np.sum(runs == names[k])) for c, k in enumerate(drawn)]
            )
            model = clone(estimator)
            part = X.iloc[rows].reset_index(drop=True)
            told = {"groups": copies} if has_fit_parameter(model, "groups") else {}
            fitted.append(model.fit(part, y[rows], **told))
        return cls.from_estimators(fitted, X, atmospheric_pressure=atmospheric_pressure, n_points=n_points)

    @classmethod
    def from_estimators(
        cls,
        estimators: Sequence[Any],
        X: pd.DataFrame,
        *,
        atmospheric_pressure: float = ATMOSPHERIC_PRESSURE,
        n_points: int = 40,
    ) -> Self:
        """Take fitted estimators, such as those of ``cross_validate(..., return_estimator=True)``.

        Parameters
        ----------
        estimators : sequence of estimators
            Fitted, each with a method ``volume(X)``; with one there is no uncertainty.
        X : DataFrame
            Signals, with ``eps`` and ``P`` (Pa, absolute): they say what range to show.
        """
        from scipy.spatial import cKDTree

        estimators = [with_volume(estimator) for estimator in estimators]
        at = np.column_stack([column(X, "eps"), column(X, "P")])
        at = at[np.isfinite(at).all(axis=1)]
        low, high = np.quantile(at, [0.002, 0.998], axis=0)
        eps, P = (np.linspace(low[k], high[k], n_points) for k in (0, 1))
        grid = np.column_stack([np.tile(eps, n_points), np.repeat(P, n_points)])
        volumes = []
        for estimator in estimators:
            jet = estimator.volume(resting(estimator, *grid.T))
            volumes.append(np.broadcast_to(np.asarray(jet.V, dtype=float), len(grid)).reshape(n_points, n_points))
        stack, span = np.stack(volumes), np.where(high > low, high - low, 1.0)
        near, _ = cKDTree(at[spaced(len(at), 4000)] / span).query(grid / span)
        known = (near < _FAR).reshape(n_points, n_points)
        spread = stack.std(axis=0, ddof=1) if len(stack) > 1 else np.zeros_like(stack[0])
        return cls(eps, P - atmospheric_pressure, stack.mean(axis=0), spread, known)

    @classmethod
    def from_predictions(cls, eps: Any, p_gauge: Any, V: Any, V_std: Any = None) -> Self:
        """Take a surface as it is.

        Parameters
        ----------
        eps : array_like, shape (n_eps,)
            Contraction ratio.
        V, V_std : array_like, shape (n_pressures, n_eps)
            Volume and its standard deviation, m³.
        """
        V = np.asarray(V, dtype=float)
        spread = np.zeros_like(V) if V_std is None else np.asarray(V_std, dtype=float)
        return cls(np.asarray(eps, float), np.asarray(p_gauge, float), V, spread, np.ones(V.shape, dtype=bool))

    def plot(self, ax: Axes | None = None) -> Self:
        """Draw the surface; pale where there were no data, lines of equal uncertainty in per cent."""
        with style():
            self.figure_, self.ax_ = drawn_on(ax)
            x, y, V = 100 * self.eps, self.p_gauge / 1e5, 1e6 * self.V
            levels = np.linspace(V.min(), V.max(), 15) if np.ptp(V) > 0 else [V.min() - 1e-9, V.min() + 1e-9]
            filled = self.ax_.contourf(x, y, V, levels=levels, cmap="cividis")
            if not self.known.all():
                self.ax_.contourf(x, y, (~self.known).astype(float), levels=[0.5, 1.5], colors=["white"], alpha=0.65)
            relative = 100 * self.V_std / np.maximum(np.abs(self.V), 1e-300)
            if np.ptp(relative) > 0:
                known = relative[self.known] if self.known.any() else relative
                steps = sorted({float(f"{v:.1g}") for v in np.quantile(known, [0.1, 0.35, 0.65, 0.9])})
                lines = self.ax_.contour(x, y, relative, levels=steps, colors=[INK], linewidths=0.8)
                self.ax_.clabel(lines, fmt=lambda v: f"±{v:g} %", fontsize=7)
            self.figure_.colorbar(filled, ax=self.ax_, label="volume V / cm³", format="%.3g")
            self.ax_.set(xlabel="contraction / %", ylabel="gauge pressure / bar")
        return self

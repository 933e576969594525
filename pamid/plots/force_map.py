"""Static force of a muscle over contraction and pressure."""

from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ..constants import ATMOSPHERIC_PRESSURE
from ..errors import ParameterError
from ..explained import explained_fields
from ..signals.thinning import spaced
from ._display import Display
from ._signals import column, resting
from .style import drawn_on, style


@explained_fields
@dataclass(eq=False, repr=False)
class ForceMapDisplay(Display):
    """Force over contraction and gauge pressure at rest, with the samples that a fit had.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import GeometricForce
    >>> from pamid.plots import ForceMapDisplay
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.2, 99), "P": rng.uniform(2e5, 6e5, 99)})
    >>> fit = GeometricForce().fit(X, 1e-3 * (X["P"] - 101325) * (1 - 3 * X["eps"]))
    >>> ForceMapDisplay.from_estimator(fit, X).force.shape
    (60, 60)
    """

    eps: Annotated[np.ndarray, "Contraction ratio, dimensionless; shape (n_eps,)."]
    p_gauge: Annotated[np.ndarray, "Gauge pressure, Pa; shape (n_pressures,)."]
    force: Annotated[np.ndarray, "Force at rest (no rates), N; shape (n_pressures, n_eps)."]
    samples: Annotated[np.ndarray, "Contraction and gauge pressure of some samples; shape (n_samples, 2)."]

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: pd.DataFrame, *, atmospheric_pressure: float = ATMOSPHERIC_PRESSURE, n_points: int = 60
    ) -> Self:
        """Predict the force at rest over the range of the data.

        Parameters
        ----------
        estimator : estimator
            Fitted on a DataFrame with ``eps``, ``P`` and, where it needs them, ``deps`` and ``dP``.
        X : DataFrame
            The data, with ``eps`` and ``P`` (Pa, absolute).

        Raises
        ------
        MissingColumnError
            If X has no ``eps`` or ``P``.
        ParameterError
            If there are fewer than two points.
        """
        eps_all, P_all = column(X, "eps"), column(X, "P")
        if n_points < 2:
            raise ParameterError(f"n_points is {n_points}.", "at least 2", "Raise it.")
        eps, P = (np.linspace(a.min(), a.max(), n_points) for a in (eps_all, P_all))
        grid = resting(estimator, np.tile(eps, n_points), np.repeat(P, n_points))
        force = np.asarray(estimator.predict(grid), dtype=float)
        force = (force[:, 0] if force.ndim == 2 else force).reshape(n_points, n_points)
        samples = np.column_stack([eps_all, P_all - atmospheric_pressure])[spaced(len(X), 800)]
        return cls(eps, P - atmospheric_pressure, force, samples)

    @classmethod
    def from_predictions(cls, eps: Any, p_gauge: Any, force: Any, samples: Any = None) -> Self:
        """Take a map as it is.

        Parameters
        ----------
        force : array_like, shape (n_pressures, n_eps)
            Force at rest, N.
        samples : array_like, shape (n_samples, 2), optional
            Contraction and gauge pressure of samples to show.
        """
        shown = np.zeros((0, 2)) if samples is None else np.asarray(samples, dtype=float)
        return cls(np.asarray(eps, float), np.asarray(p_gauge, float), np.asarray(force, float), shown)

    def plot(self, ax: Axes | None = None) -> Self:
        """Draw the map with its samples."""
        with style():
            self.figure_, self.ax_ = drawn_on(ax)
            x, y = 100 * self.eps, self.p_gauge / 1e5
            filled = self.ax_.contourf(x, y, self.force, levels=14, cmap="cividis")
            self.ax_.scatter(
                100 * self.samples[:, 0], self.samples[:, 1] / 1e5, s=1.5, color="white", alpha=0.8, linewidths=0
            )
            self.figure_.colorbar(filled, ax=self.ax_, label="force at rest / N")
            self.ax_.set_xlabel("contraction / %")
            self.ax_.set_ylabel("gauge pressure / bar")
        return self

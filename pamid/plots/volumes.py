"""The gas volume that an estimator has identified, and its slope, over the contraction."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import ExcitationError
from ..explained import explained_fields
from ._display import Display
from ._signals import column, resting, with_volume
from .style import FAINT, GREY, INK, checked_ending, drawn_on, new_figure, save_figure, style

_POINTS = 81
_LEAST = 5e-3  # contraction over which a volume is drawn at least


@explained_fields
@dataclass(eq=False, repr=False)
class VolumeDisplay(Display):
    """Identified volume of a muscle over its contraction, at several pressures, beside its geometry.

    See Also
    --------
    volume_plot : Volume and slope in one figure.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import GeometricForce
    >>> from pamid.plots import VolumeDisplay
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.2, 99), "P": rng.uniform(2e5, 6e5, 99)})
    >>> fit = GeometricForce().fit(X, 1e-3 * (X["P"] - 101325) * (1 - 3 * X["eps"]))
    >>> display = VolumeDisplay.from_estimator(fit, X)
    >>> display.V.shape
    (3, 81)
    """

    eps: Annotated[np.ndarray, "Contraction ratio, dimensionless; shape (n_points,)."]
    pressures: Annotated[np.ndarray, "Absolute pressures, Pa; shape (n_pressures,)."]
    V: Annotated[np.ndarray, "Volume and its slope ∂V/∂ε, m³; shape (n_pressures, n_points)."]
    V_eps: Annotated[np.ndarray, "Volume and its slope ∂V/∂ε, m³; shape (n_pressures, n_points)."]
    covered: Annotated[
        np.ndarray, "Contractions between which there were data near each pressure; shape (n_pressures, 2)."
    ]
    geometry: Annotated[
        dict[str, tuple[np.ndarray, np.ndarray]], "Volume and slope of geometric models to draw beside, by name."
    ]

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: pd.DataFrame,
        *,
        rest_length: float | None = None,
        rest_diameter: float | None = None,
        braid_angle: float | None = None,
        n_pressures: int = 3,
    ) -> Self:
        """Read the volume that a fitted estimator has identified.

        Parameters
        ----------
        estimator : estimator
            Fitted, with a method ``volume(X)``.
        X : DataFrame
            The data: columns ``eps`` and ``P`` (Pa, absolute) say what range to show.
        rest_length, rest_diameter : float, optional
            L₀ and D₀, m, of the geometry to draw beside; those of the estimator by default.
        braid_angle : float, optional
            θ₀, rad; without it only the cylinder is drawn beside.
        n_pressures : int, default=3
            Number of pressures, spread over those of the data.

        Raises
        ------
        IncompatibleError
            If the estimator identifies no volume.
        MissingColumnError
            If X has no ``eps`` or ``P``.
        ExcitationError
            If the contraction is constant, as in an isometric log.
        """
        estimator, all_eps, all_P = with_volume(estimator), column(X, "eps"), column(X, "P")
        low, high = np.quantile(all_P, (0.1, 0.9))
        pressures = np.linspace(low, high, n_pressures)
        least, most = np.quantile(all_eps, (0.001, 0.999))
        if most - least < _LEAST:
            raise ExcitationError(
                f"The contraction stays between {100 * least:.4g} and {100 * most:.4g} %.",
                f"data over {100 * _LEAST:g} % of contraction at least, to draw a volume over it",
                "Take runs at other contractions as well.",
            )
        eps = np.linspace(least, most, _POINTS)
        covered = np.array([_covered(all_eps, all_P, P) for P in pressures])
        grid = resting(estimator, np.tile(eps, n_pressures), np.repeat(pressures, _POINTS))
        jet = estimator.volume(grid)
        length = rest_length or getattr(estimator, "rest_length", None)
        diameter = rest_diameter or getattr(estimator, "rest_diameter", None)
        geometry = _geometry(eps, length, diameter, braid_angle) if length and diameter else {}
        shape = (n_pressures, _POINTS)
        V, V_eps = (np.broadcast_to(np.asarray(a, dtype=float), len(grid)).reshape(shape) for a in (jet.V, jet.V_eps))
        return cls(eps, pressures, V, V_eps, covered, geometry)

    def plot(self, ax: Axes | None = None, *, slope: bool = False) -> Self:
        """Draw the volume, or its slope.

        Parameters
        ----------
        slope : bool, default=False
            Whether to draw ∂V/∂ε instead of V.
        """
        with style():
            self.figure_, self.ax_ = drawn_on(ax)
            self._draw(self.ax_, slope)
            self.ax_.legend()
        return self

    def _draw(self, ax: Axes, slope: bool) -> None:
        values = self.V_eps if slope else self.V
        for name, (V, V_eps) in self.geometry.items():
            dash = (0, (1, 2)) if name == "cylinder" else (0, (4, 3))
            ax.plot(
                100 * self.eps, 1e6 * (V_eps if slope else V), color=GREY, linewidth=1.0, linestyle=dash, label=name
            )
        for k, P in enumerate(self.pressures):
            colour = colormaps["viridis"](0.1 + 0.7 * k / max(len(self.pressures) - 1, 1))
            inside = (self.eps >= self.covered[k, 0]) & (self.eps <= self.covered[k, 1])
            ax.plot(100 * self.eps, 1e6 * values[k], color=colour, linewidth=0.7, alpha=0.45)
            shown = np.where(inside, 1e6 * values[k], np.nan)
            ax.plot(100 * self.eps, shown, color=colour, linewidth=2.0, label=f"{P / 1e5:.2g} bar, absolute")
        ax.set_xlabel("contraction / %")
        ax.set_ylabel("slope of the volume, ∂V/∂ε / cm³" if slope else "volume V / cm³")
        if slope and ax.get_ylim()[0] < 0 < ax.get_ylim()[1]:
            ax.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0)


def volume_plot(
    estimator: Any,
    X: pd.DataFrame,
    path: str | Path | None = None,
    *,
    title: str = "",
    level: bool = True,
    **geometry: Any,
) -> Figure:
    """Draw the identified volume and its slope over the contraction, at several pressures, beside the geometry.

    Thick lines show where there were data near the pressure, thin ones where the model extrapolates.

    Parameters
    ----------
    estimator : estimator
        Fitted, with a method ``volume(X)``.
    X : DataFrame
        The data, with ``eps`` and ``P`` (Pa, absolute).
    path : path-like, optional
        PNG or SVG to write.
    title : str, default=""
        Title of the figure.
    level : bool, default=True
        Whether to draw the volume beside its slope; a force alone does not determine the level.
    **geometry
        ``rest_length`` (m), ``rest_diameter`` (m), ``braid_angle`` (rad), ``n_pressures``: see
        `VolumeDisplay.from_estimator`.

    Returns
    -------
    Figure
        The figure.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from pamid.estimators import GeometricForce
    >>> from pamid.plots import volume_plot
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"eps": rng.uniform(0, 0.2, 99), "P": rng.uniform(2e5, 6e5, 99)})
    >>> fit = GeometricForce().fit(X, 1e-3 * (X["P"] - 101325) * (1 - 3 * X["eps"]))
    >>> figure = volume_plot(fit, X)
    """
    if path is not None:
        path = checked_ending(path)
    display = VolumeDisplay.from_estimator(estimator, X, **geometry)
    with style():
        figure, axes = new_figure(8.2 if level else 4.6, 3.6, 1, 1 + level)
        for ax, slope in zip(axes[0], (False, True)[1 - level :], strict=True):
            display._draw(ax, slope)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        handles += axes[0, 0].plot([], [], color=INK, linewidth=0.8, alpha=0.5)
        labels += ["thin: no data there"]
        figure.legend(handles, labels, loc="outside lower center", ncols=-(-len(labels) // 2))
        figure.suptitle(title or type(estimator).__name__, x=0.01, ha="left", fontsize=10, color=INK)
        if path is not None:
            save_figure(figure, path)
    return figure


def _covered(eps: np.ndarray, P: np.ndarray, level: float) -> tuple[float, float]:
    """Range of contraction among the samples whose pressure is near a level."""
    near = eps[np.abs(P - level) <= 0.1 * max(float(np.ptp(P)), 1.0)]
    if not len(near):
        return np.inf, -np.inf
    return float(np.quantile(near, 0.01)), float(np.quantile(near, 0.99))


def _geometry(
    eps: np.ndarray, length: float, diameter: float, braid_angle: float | None
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Volumes of a cylinder of constant diameter and, if its angle is known, of a braided one."""
    from ..signals.state import State
    from ..volume import all_volumes

    zero = np.zeros_like(eps)
    state = State(eps, zero, zero + 3e5, zero)
    volumes = all_volumes()
    chosen = {"cylinder": "cylinder"} | ({"nominal geometry": "chou_hannaford"} if braid_angle else {})
    found = {}
    for label, name in chosen.items():
        jet = volumes[name].from_geometry(length, diameter, braid_angle or 0.4363).jet(state)
        found[label] = (np.asarray(jet.V), np.asarray(jet.V_eps))
    return found

"""What pictures of an estimator have in common: their axes, and the explanation of what all of them take."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..explained import explain, explain_methods


class DisplayMethods:
    """What methods of the same name have in common; never made."""

    def from_estimator(self) -> Any:
        """Take an estimator.

        Parameters
        ----------
        estimator : estimator
            Fitted.
        y : array_like, shape (n_samples,)
            Measured target, SI.
        y_true, y_pred : array_like, shape (n_samples,)
            Measured and predicted target, SI.
        eps : array_like, shape (n_eps,)
            Contraction ratio, dimensionless.
        p_gauge : array_like, shape (n_pressures,)
            Gauge pressure, Pa.
        groups : array_like, shape (n_samples,), optional
            Run of each row; the column ``trajectory`` by default.
        unit : str
            SI unit of the target: ``"N"``, ``"kg/s"``, ``"Pa"``.
        over : tuple of str
            Columns on the axes.
        cells : tuple of int
            Cells along the two axes.
        across : str
            Column on the axis.
        atmospheric_pressure : float
            Pa, absolute.
        n_points : int
            Points along each axis.

        Returns
        -------
        Display
            To be drawn with ``plot``.
        """

    from_predictions = from_estimators = from_estimator

    def plot(self) -> Any:
        """Draw.

        Parameters
        ----------
        ax : Axes, optional
            Where; a new figure of pyplot by default.

        Returns
        -------
        Display
            With the attributes ``ax_`` and ``figure_``.
        """


class Display:
    """A picture.

    Attributes
    ----------
    ax_ : Axes
        Where it was drawn.
    figure_ : Figure
        Its figure.
    """

    ax_: Axes
    figure_: Figure

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        explain(cls)
        explain_methods(cls, DisplayMethods)

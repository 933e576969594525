"""From a pressure and a load to force and contraction at the same time."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pamid.errors import ExtrapolationWarning

from ._base import Signals
from ._one_layer import OneLayerRegressor

_MARGIN = 0.05  # of an output's range, by which an answer may pass the outputs of the fit


class ForwardAnswer(NamedTuple):
    """Predictions of a forward model, row by row, with flags of their reliability.

    Parameters
    ----------
    outputs : ndarray, shape (n_samples, n_outputs)
        Outputs within their bounds.
    saturated : ndarray of bool, shape (n_samples,)
        Whether the output is at a bound.
    extrapolated : ndarray of bool, shape (n_samples,)
        Whether the fit had no rows nearby.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import ForwardModel
    >>> X = pd.DataFrame({"P": np.linspace(1e5, 7e5, 50), "load": np.tile([20.0, 40.0], 25)})
    >>> model = ForwardModel(hidden=3, random_state=0).fit(X, np.c_[9.81 * X["load"], 3e-7 * X["P"]])
    >>> answer = model.assess(pd.DataFrame({"P": [4e5, 2e6], "load": [20.0, 20.0]}))
    >>> answer.outputs.shape, answer.extrapolated.tolist()
    ((2, 2), [False, True])
    """

    outputs: np.ndarray
    saturated: np.ndarray
    extrapolated: np.ndarray


class ForwardModel(OneLayerRegressor):
    r"""Integrated response of a loaded muscle: force and contraction together from pressure and load.

    .. math:: (F, \varepsilon) = N\!\left(P, m\right)

    with one hidden layer that both outputs share, trained by Levenberg–Marquardt. A force model needs the contraction
    and a contraction model the force; under a load neither is known, and both follow from the pressure.

    Parameters
    ----------
    inputs : sequence of str, default=("P", "load")
        Signals that the network reads: absolute pressure (Pa), load (kg); also ``"dP"`` (Pa/s) or any other column.
    hidden : int, default=10
        Units of the hidden layer.
    direction : bool, default=False
        Whether the last direction of the first input is an input, too; needs runs in time order.
    direction_step : float, default=100000
        Reversal over which the direction switches, in its unit (Pa); the input changes gradually over it.
    alpha : float, default=0.01
        Weight decay: factor of the squared weights in the sum of squares of the standardised targets, dimensionless.
    max_iter : int, default=200
        Maximum number of Levenberg–Marquardt steps.
    tol : float, default=1e-5
        Relative improvement of the loss that counts, dimensionless; five steps with less end the fit.
    n_starts : int, default=3
        Initial weights tried for a few steps; the best are trained further.
    forget_rows : float, optional
        Rows over which `partial_fit` forgets; by default all rows count alike.
    one_trajectory : bool, default=False
        Whether all rows are one run, where neither groups nor a column says otherwise.
    trajectory_column : int, optional
        Position of the column that names the runs, for arrays that have no names.
    random_state : int or RandomState, optional
        Seed of the initial weights.
    signals : mapping of str to str or int, optional
        Column of a signal, by name or position, where it is not the signal's own name or place.

    Attributes
    ----------
    weights_ : dict of str to ndarray
        ``W0`` (n_inputs, hidden), ``b0``, ``W1`` (hidden, n_outputs), ``b1``.
    input_mean_, input_scale_, input_low_, input_high_ : ndarray, shape (n_inputs,)
        Mean, standard deviation and range of the inputs, in their units.
    target_mean_, target_scale_, target_low_, target_high_ : ndarray, shape (n_outputs,)
        The same of the outputs.
    cells_ : ndarray of int, shape (n_cells, n_inputs)
        Cells of the input space that held rows of the fit.
    loss_curve_ : list of float
        Loss after each step, per row, in units of the targets' variances.
    n_iter_ : int
        Steps of the last fit, and of `partial_fit` since.
    signal_columns_ : dict of str to int
        Column of each signal.
    n_outputs_ : int
        Number of outputs; 0 for one without an axis of its own.
    n_features_in_ : int
        Number of columns seen in fit.
    feature_names_in_ : ndarray of str
        Names of these columns, if they have names.

    See Also
    --------
    InverseModel : The pressure for a wanted force and contraction.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import ForwardModel
    >>> rng = np.random.default_rng(0)
    >>> X = pd.DataFrame({"P": rng.uniform(1e5, 7e5, 500), "load": rng.uniform(15, 100, 500)})
    >>> force = 9.81 * X["load"]
    >>> eps = 0.25 * (1 - np.exp(-(X["P"] - 1e5) / (3e3 * X["load"] + 1e5)))
    >>> model = ForwardModel(random_state=0).fit(X, np.c_[force, eps])
    >>> model.predict(X).shape, bool(model.score(X, np.c_[force, eps]) > 0.99)
    ((500, 2), True)
    """

    equations = ("dynamic",)

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {"": {}, "direction": {"direction": True}}

    @property
    def _turning(self) -> str:  # type: ignore[override]
        return str(next(iter(self.inputs)))

    def __init__(
        self,
        inputs: Sequence[str] = ("P", "load"),
        *,
        hidden: int = 10,
        direction: bool = False,
        direction_step: float = 1e5,
        alpha: float = 0.01,
        max_iter: int = 200,
        tol: float = 1e-5,
        n_starts: int = 3,
        forget_rows: float | None = None,
        one_trajectory: bool = False,
        trajectory_column: int | None = None,
        random_state: Any = None,
        signals: Signals | None = None,
    ) -> None:
        self.inputs = inputs
        self.hidden = hidden
        self.direction = direction
        self.direction_step = direction_step
        self.alpha = alpha
        self.max_iter = max_iter
        self.tol = tol
        self.n_starts = n_starts
        self.forget_rows = forget_rows
        self.one_trajectory = one_trajectory
        self.trajectory_column = trajectory_column
        self.random_state = random_state
        self.signals = signals

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def assess(self, X: Any, groups: Any = None) -> ForwardAnswer:
        """Predict within bounds, and flag rows whose prediction is unreliable.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Signals, SI units.
        groups : array_like, shape (n_samples,), optional
            Run of each row, read if `direction` is set.

        Returns
        -------
        ForwardAnswer
            Outputs in the units of y, and flags.
        """
        bare, outside = self._answer(X, groups)
        margin = _MARGIN * (self.target_high_ - self.target_low_)
        held = np.clip(bare, self.target_low_ - margin, self.target_high_ + margin)
        return ForwardAnswer(held, (held != bare).any(axis=1), outside)

    def _bounded(self, bare: np.ndarray, outside: np.ndarray) -> np.ndarray:
        if outside.any():
            warnings.warn(
                f"ForwardModel: {int(outside.sum())} of {len(bare)} rows lie outside the data of the fit. Expected "
                "pressures and loads that it covered. Predictions are bounded; assess() marks each row.",
                ExtrapolationWarning,
                stacklevel=4,
            )
        return self._shaped(np.clip(bare, *self._limits()))

    def _limits(self) -> tuple[np.ndarray, np.ndarray]:
        margin = _MARGIN * (self.target_high_ - self.target_low_)
        return self.target_low_ - margin, self.target_high_ + margin

    @staticmethod
    def _checked_instances() -> list[ForwardModel]:
        return [ForwardModel(signals={"P": 0, "load": 0}, hidden=3, max_iter=4, n_starts=1, random_state=0)]

"""An autoregressive network with inputs: the output from its own past and that of the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pamid.fitting.epochs import local_generator
from pamid.fitting.one_layer import derivatives, flatten, forward, initial_weights, marquardt_on_rows, unflatten

from ._base import Signals
from ._checks import check_counts
from ._narx import NARXRegressor

_ONE_STEP = 30


class NNARX(NARXRegressor):
    r"""Neural autoregressive model with inputs, fitted to free runs.

    .. math:: y_t = y_{t-1} + \sigma\, N(y_{t-1}, \dots, y_{t-n_a}, u_t, \dots, u_{t-n_b+1})

    with one hidden layer that gives the step of the output. It is fitted to single steps first, then to free runs
    over `horizon` rows, whose derivatives are carried along the run: a model that is right one step ahead may drift or
    diverge when it runs on its own outputs.

    Parameters
    ----------
    inputs : sequence of str, default=("P", "load")
        Signals that drive the output: absolute pressure (Pa), load (kg), valve command or any other column.
    output_lags : int, default=2
        Past rows of the output that the model reads.
    input_lags : int, default=2
        Rows of the inputs that it reads, the present one first.
    hidden : int, default=10
        Units of the hidden layer.
    horizon : int, default=50
        Rows of the free runs that the fit uses; 1 for single steps.
    start : str, optional
        Signal that holds, in the first row of each run, the output before it; by default a free run starts
        from the mean of the first outputs of the fit.
    alpha : float, default=1.0
        Weight decay: factor of 1e-6 of the squared weights in the mean squared error, dimensionless.
    margin : float, default=0.2
        Share of the range of the outputs of the fit by which a free run may leave it, dimensionless.
    max_iter : int, default=60
        Maximum number of Levenberg–Marquardt steps.
    tol : float, default=1e-4
        Relative improvement of the loss that counts, dimensionless; three steps with less end the fit.
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
        ``W0`` (n_lags, hidden), ``b0``, ``W1`` (hidden, 1), ``b1``.
    input_mean_, input_scale_, input_low_, input_high_ : ndarray, shape (n_inputs,)
        Mean, standard deviation and range of the inputs, in their units.
    output_mean_, output_scale_, output_low_, output_high_ : float
        The same of the output.
    step_scale_ : float
        Root mean square of the output's step from row to row, in units of `output_scale_`.
    start_mean_ : float
        Mean of the first outputs of the runs of the fit.
    loss_curve_ : list of float
        Mean squared error over the horizon after each step of the fit, in units of the output's variance.
    n_iter_ : int
        Steps of the fit.
    n_parameters_ : int
        Number of parameters.
    signal_columns_ : dict of str to int
        Column of each signal.
    n_features_in_ : int
        Number of columns seen in fit.
    feature_names_in_ : ndarray of str
        Names of these columns, if they have names.

    See Also
    --------
    PolynomialNARX : The same with few monomials in place of the network.
    Recurrent : A network with a state of its own.

    References
    ----------
    K. K. Ahn, H. P. H. Anh, "Design and implementation of an adaptive recurrent neural networks (ARNN) controller of
    the pneumatic artificial muscle (PAM) manipulator", Mechatronics 19(6), 2009.
    https://doi.org/10.1016/j.mechatronics.2009.04.006

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import NNARX
    >>> P = np.repeat(np.random.default_rng(0).uniform(1e5, 7e5, 60), 10)
    >>> eps = np.zeros(600)
    >>> for k in range(1, 600):
    ...     eps[k] = eps[k - 1] + 0.2 * (0.2 * np.tanh(P[k] / 4e5) - eps[k - 1])
    >>> X = pd.DataFrame({"P": P})
    >>> model = NNARX(("P",), hidden=5, one_trajectory=True, random_state=0).fit(X, eps)
    >>> bool(model.score(X, eps) > 0.99)
    True
    """

    @classmethod
    def settings(cls, equation: str) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {"": {}, "one step": {"horizon": 1}}

    def __init__(
        self,
        inputs: Sequence[str] = ("P", "load"),
        *,
        output_lags: int = 2,
        input_lags: int = 2,
        hidden: int = 10,
        horizon: int = 50,
        start: str | None = None,
        alpha: float = 1.0,
        margin: float = 0.2,
        max_iter: int = 60,
        tol: float = 1e-4,
        one_trajectory: bool = False,
        trajectory_column: int | None = None,
        random_state: Any = None,
        signals: Signals | None = None,
    ) -> None:
        self.inputs = inputs
        self.output_lags = output_lags
        self.input_lags = input_lags
        self.hidden = hidden
        self.horizon = horizon
        self.start = start
        self.alpha = alpha
        self.margin = margin
        self.max_iter = max_iter
        self.tol = tol
        self.one_trajectory = one_trajectory
        self.trajectory_column = trajectory_column
        self.random_state = random_state
        self.signals = signals

    def _check_parameters(self) -> None:
        super()._check_parameters()
        check_counts(self, "hidden")

    def _n_lags(self) -> int:
        return int(self.output_lags) + int(self.input_lags) * len(self.inputs)

    def _weights(self, theta: np.ndarray) -> dict[str, np.ndarray]:
        return unflatten(theta, self._n_lags(), int(self.hidden), 1)

    def _one_step(self, phi: np.ndarray, step: np.ndarray) -> np.ndarray:
        weights = initial_weights(local_generator(self.random_state), phi.shape[1], int(self.hidden), 1)
        steps = marquardt_on_rows(weights, phi, step[:, None], np.ones(len(phi)), 1e-6 * len(phi))
        for _ in range(min(_ONE_STEP, int(self.max_iter))):
            if not steps.step():
                break
        return steps.x

    def _function(self, theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        return forward(self._weights(theta), phi)[:, 0]

    def _derivatives(self, theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        f, to_phi, to_theta = derivatives(self._weights(theta), phi)
        return f[:, 0], to_phi[:, 0], to_theta[:, 0]

    def _keep(self, theta: np.ndarray, covariance: np.ndarray) -> None:
        self.weights_ = self._weights(theta)

    def _theta(self) -> np.ndarray:
        return flatten(self.weights_)

    @staticmethod
    def _checked_instances() -> list[NNARX]:
        # each row a run of its own, as predictions must not change with the order of rows
        one: dict[str, Any] = {"signals": {"x": 0}, "trajectory_column": 0, "random_state": 0}
        return [NNARX(("x",), hidden=2, horizon=4, max_iter=3, **one)]

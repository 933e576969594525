"""An autoregressive network with inputs: the output from its own past and that of the inputs."""

from dataclasses import KW_ONLY
from typing import Any

import numpy as np

from pamid.fitting.epochs import local_generator
from pamid.fitting.one_layer import derivatives, flatten, forward, initial_weights, marquardt_on_rows, unflatten

from ._checks import check_counts
from ._narx import NARXRegressor
from ._parameters import parameters

_ONE_STEP = 30


@parameters
class NNARX(NARXRegressor):
    r"""Neural autoregressive model with inputs, fitted to free runs.

    .. math:: y_t = y_{t-1} + \sigma\, N(y_{t-1}, \dots, y_{t-n_a}, u_t, \dots, u_{t-n_b+1})

    with one hidden layer that gives the step of the output. It is fitted to single steps first, then to free runs
    over `horizon` rows, whose derivatives are carried along the run: a model that is right one step ahead may drift or
    diverge when it runs on its own outputs.

    Parameters
    ----------
    alpha : float, default=1.0
        Weight decay: factor of 1e-6 of the squared weights in the mean squared error, dimensionless.

    Attributes
    ----------
    weights_ : dict of str to ndarray
        ``W0`` (n_lags, hidden), ``b0``, ``W1`` (hidden, 1), ``b1``.

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

    _: KW_ONLY
    output_lags: int = 2
    input_lags: int = 2
    hidden: int = 10
    alpha: float = 1.0
    random_state: Any = None

    _checked = (
        {"inputs": ("x",), "hidden": 2, "horizon": 4, "max_iter": 3, "trajectory_column": 0, "random_state": 0},
    )

    def _check_parameters(self) -> None:
        super()._check_parameters()
        check_counts(self, "hidden")

    def _weights(self, theta: np.ndarray) -> dict[str, np.ndarray]:
        n_lags = int(self.output_lags) + int(self.input_lags) * len(self.inputs)
        return unflatten(theta, n_lags, int(self.hidden), 1)

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

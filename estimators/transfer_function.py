"""A linear transfer function from inputs to an output, fitted to its output error."""

from dataclasses import KW_ONLY
from typing import Any, ClassVar

import numpy as np
from sklearn.utils.validation import check_is_fitted

from pamid.errors import needs

from ._checks import check_counts
from ._narx import NARXRegressor
from ._parameters import parameters


@parameters
class TransferFunction(NARXRegressor):
    r"""Discrete transfer function of each input with common poles, fitted to free runs (output error).

    .. math:: A(q)\,y_t = \sum_i B_i(q)\,u_{i,\,t-d} + c, \qquad
        A = 1 + a_1 q^{-1} + \dots + a_n q^{-n}, \quad B_i = b_{i0} + b_{i1} q^{-1} + \dots + b_{im} q^{-m}

    Least squares on single steps is the start; Levenberg–Marquardt then fits free runs over `horizon` rows. It is the
    baseline that any model with physics or a network has to beat.

    Parameters
    ----------
    n_poles : int, default=2
        Number n of poles.
    n_zeros : int, default=1
        Number m of zeros of each input.
    delay : int, default=0
        Dead time d of all inputs, in rows.
    horizon : int, default=1000
        Rows of the free runs that the fit uses, each from measured outputs; 1 for single steps (ARX).

    Attributes
    ----------
    denominator_ : ndarray, shape (n_poles + 1,)
        1, a₁, ... aₙ.
    numerators_ : dict of str to ndarray, shape (n_zeros + 1,)
        b₀, ... bₘ of each input, in units of the output over those of the input.
    offset_ : float
        c, in the unit of the output.
    poles_ : ndarray of complex, shape (n_poles,)
        Roots of A, in the plane of z.
    static_gains_ : dict of str to float
        Change of the output over that of each input at rest; infinite where a pole is 1.
    coefficients_ : dict of str to float
        All coefficients by name, such as ``"a1"`` and ``"b0 P"``.
    standard_errors_ : dict of str to float
        Their standard errors, in the same units, if the errors of free runs are white.
    coef_ : ndarray, shape (n_poles + n_inputs * (n_zeros + 1) + 1,)
        The parameters as they were fitted, in standardised signals.

    See Also
    --------
    LinearStateSpace : A linear model whose order is found from the data.
    PolynomialNARX : The same with products and powers of the lags.

    References
    ----------
    L. Ljung, "System Identification: Theory for the User", 2nd edition, Prentice Hall, 1999, section 4.2.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import TransferFunction
    >>> P = np.repeat(np.random.default_rng(0).uniform(1e5, 7e5, 60), 10)
    >>> eps = np.full(600, 4e-7 * P[0])
    >>> for k in range(1, 600):
    ...     eps[k] = 0.8 * eps[k - 1] + 8e-8 * P[k]
    >>> X = pd.DataFrame({"P": P})
    >>> model = TransferFunction(("P",), n_poles=1, n_zeros=0, one_trajectory=True).fit(X, eps)
    >>> round(float(model.poles_[0].real), 3), f"{model.static_gains_['P']:.3g}"
    (0.8, '4e-07')
    """

    _: KW_ONLY
    n_poles: int = 2
    n_zeros: int = 1
    delay: int = 0
    horizon: int = 1000

    _settings: ClassVar = {"2 poles": {}, "3 poles": {"n_poles": 3, "n_zeros": 2}, "ARX": {"horizon": 1}}
    _checked = ({"inputs": ("x",), "n_poles": 1, "n_zeros": 0, "horizon": 4, "max_iter": 3, "trajectory_column": 0},)

    @property
    def output_lags(self) -> int:
        """Past rows of the output that the model reads."""
        return int(self.n_poles)

    @property
    def input_lags(self) -> int:
        """Rows of each input that the model reads."""
        return int(self.n_zeros) + 1

    def _check_parameters(self) -> None:
        check_counts(self, "n_poles")
        check_counts(self, "n_zeros", "delay", least=0)
        super()._check_parameters()

    def _one_step(self, phi: np.ndarray, step: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.lstsq(_with_one(phi), step, rcond=None)[0])

    def _function(self, theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        return np.asarray(phi @ theta[:-1] + theta[-1])

    def _derivatives(self, theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._function(theta, phi), np.broadcast_to(theta[:-1], phi.shape), _with_one(phi)

    def _keep(self, theta: np.ndarray, covariance: np.ndarray) -> None:
        self.coef_ = theta.copy()
        n, names = int(self.n_poles), [str(name) for name in self.inputs]
        step = self.step_scale_
        b = np.tile(step * self.output_scale_ / self.input_scale_, self.input_lags)
        turn = np.diag(np.concatenate([np.full(n, -step), b, [step * self.output_scale_]]))  # to units of the signals
        values = turn @ theta
        errors = np.sqrt(np.maximum(np.diag(turn @ covariance @ turn.T), 0.0))
        self.denominator_ = np.concatenate([[1.0], values[:n]])
        self.denominator_[1] -= 1.0  # the model steps from the output before
        by_lag = values[n:-1].reshape(-1, len(names))
        self.numerators_ = {name: by_lag[:, k].copy() for k, name in enumerate(names)}
        at_rest = float(np.sum(self.denominator_))
        means = float(by_lag.sum(axis=0) @ self.input_mean_)
        self.offset_ = float(values[-1] + at_rest * self.output_mean_ - means)
        self.poles_ = np.roots(self.denominator_).astype(complex)
        with np.errstate(divide="ignore", invalid="ignore"):
            self.static_gains_ = {k: float(np.divide(b.sum(), at_rest)) for k, b in self.numerators_.items()}
        told = [f"a{k}" for k in range(1, n + 1)] + [f"b{k} {name}" for k in range(len(by_lag)) for name in names]
        found = np.concatenate([self.denominator_[1:], by_lag.ravel()])
        self.coefficients_ = dict(zip(told, found.tolist(), strict=True))
        self.standard_errors_ = dict(zip(told, errors[:-1].tolist(), strict=True))

    def _theta(self) -> np.ndarray:
        return self.coef_

    def to_control(self, input_name: str, sampling_interval: float) -> Any:
        """Return the transfer function of one input for python-control.

        Parameters
        ----------
        input_name : str
            The input.
        sampling_interval : float
            Time between rows, s.

        Returns
        -------
        control.TransferFunction
            In z, with that sampling interval.

        Raises
        ------
        MissingDependencyError
            python-control is not installed.
        """
        check_is_fitted(self)
        with needs("python-control", "control", "control"):
            import control
        b, a = self.numerators_[input_name], self.denominator_
        size = max(len(a), len(b) + int(self.delay))
        numerator = np.concatenate([np.zeros(int(self.delay)), b])
        pad = [np.concatenate([x, np.zeros(size - len(x))]) for x in (numerator, a)]
        return control.TransferFunction(*pad, sampling_interval)


def _with_one(phi: np.ndarray) -> np.ndarray:
    return np.column_stack([phi, np.ones(len(phi))])

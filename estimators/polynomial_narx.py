"""A polynomial autoregressive model with inputs, its terms chosen one by one."""

from dataclasses import KW_ONLY
from itertools import combinations_with_replacement

import numpy as np

from ._checks import check_counts
from ._narx import NARXRegressor
from ._parameters import parameters


@parameters
class PolynomialNARX(NARXRegressor):
    r"""Polynomial autoregressive model with inputs, its terms chosen by forward orthogonal least squares.

    .. math:: y_t = y_{t-1} + \sigma \sum_k \theta_k\, m_k(y_{t-1}, \dots, y_{t-n_a}, u_t, \dots, u_{t-n_b+1})

    with monomials of the standardised lags. Terms enter by the share of the step's variance that they explain beyond
    those before them (error reduction ratio); the coefficients are then fitted to free runs over `horizon` rows.

    Parameters
    ----------
    degree : int, default=3
        Highest degree of a monomial.
    n_terms : int, default=12
        Maximum number of terms.
    threshold : float, default=1e-6
        Share of the step's variance that a term must explain to enter, dimensionless.
    alpha : float, default=1e-3
        Ridge: factor of 1e-6 of the squared coefficients in the mean squared error, dimensionless.

    Attributes
    ----------
    powers_ : ndarray of int, shape (n_terms, n_lags)
        Exponent of each lag in each term.
    coef_ : ndarray, shape (n_terms,)
        Coefficients of the terms in standardised lags, in units of the step's root mean square.
    terms_ : list of str
        The terms, such as ``"y[t-1]*P[t]"``, in the order in which they were chosen.
    coefficients_ : dict of str to float
        The coefficients by term, in the output's unit per row.
    standard_errors_ : dict of str to float
        Their standard errors, in the same unit.

    See Also
    --------
    NNARX : The same with a network.

    References
    ----------
    S. Chen, S. A. Billings, W. Luo, "Orthogonal least squares methods and their application to non-linear system
    identification", International Journal of Control 50(5), 1989. https://doi.org/10.1080/00207178908953472

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import PolynomialNARX
    >>> P = np.repeat(np.random.default_rng(0).uniform(1e5, 7e5, 60), 10)
    >>> eps = np.zeros(600)
    >>> for k in range(1, 600):
    ...     eps[k] = 0.8 * eps[k - 1] + 8e-8 * P[k]
    >>> X = pd.DataFrame({"P": P})
    >>> model = PolynomialNARX(("P",), output_lags=1, input_lags=1, n_terms=2, one_trajectory=True).fit(X, eps)
    >>> sorted(model.terms_), bool(model.score(X, eps) > 0.99)
    (['P[t]', 'y[t-1]'], True)
    """

    _: KW_ONLY
    output_lags: int = 2
    input_lags: int = 2
    degree: int = 3
    n_terms: int = 12
    threshold: float = 1e-6
    alpha: float = 1e-3

    _checked = ({"inputs": ("x",), "degree": 2, "n_terms": 3, "horizon": 4, "max_iter": 3, "trajectory_column": 0},)

    def _check_parameters(self) -> None:
        super()._check_parameters()
        check_counts(self, "degree", "n_terms")

    def _one_step(self, phi: np.ndarray, step: np.ndarray) -> np.ndarray:
        every = _powers(phi.shape[1], int(self.degree))
        chosen, theta = _forward_choice(_monomials(phi, every), step, int(self.n_terms), float(self.threshold))
        self.powers_ = every[chosen]
        return theta

    def _function(self, theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        return np.asarray(_monomials(phi, self.powers_) @ theta)

    def _derivatives(self, theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        M = _monomials(phi, self.powers_)
        to_phi = np.zeros_like(phi)
        for i in range(int(self.output_lags)):  # those of the inputs are never needed
            lower = self.powers_.copy()
            lower[:, i] = np.maximum(lower[:, i] - 1, 0)
            to_phi[:, i] = _monomials(phi, lower) @ (theta * self.powers_[:, i])
        return M @ theta, to_phi, M

    def _keep(self, theta: np.ndarray, covariance: np.ndarray) -> None:
        self.coef_ = theta.copy()
        lags = [f"y[t-{k}]" for k in range(1, int(self.output_lags) + 1)]
        lags += [f"{name}[t-{k}]" if k else f"{name}[t]" for k in range(int(self.input_lags)) for name in self.inputs]
        self.terms_ = [
            "*".join(f"{lag}^{p}" if p > 1 else lag for lag, p in zip(lags, row, strict=True) if p) or "1"
            for row in self.powers_.tolist()
        ]
        unit = self.step_scale_ * self.output_scale_
        self.coefficients_ = dict(zip(self.terms_, (unit * theta).tolist(), strict=True))
        errors = unit * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        self.standard_errors_ = dict(zip(self.terms_, errors.tolist(), strict=True))

    def _theta(self) -> np.ndarray:
        return self.coef_


def _powers(n_lags: int, degree: int) -> np.ndarray:
    """Exponents of all monomials up to a degree, the constant first."""
    rows = [
        np.bincount(np.array(c, dtype=int), minlength=n_lags)
        for d in range(degree + 1)
        for c in combinations_with_replacement(range(n_lags), d)
    ]
    return np.array(rows, dtype=np.int64)


def _monomials(phi: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Evaluate monomials: (n, n_lags) to (n, n_terms)."""
    out = np.ones((len(phi), len(powers)))
    for lag in range(phi.shape[1]):
        x, top = phi[:, lag], int(powers[:, lag].max(initial=0))
        power = np.ones(len(phi))
        for p in range(1, top + 1):
            power = power * x
            here = powers[:, lag] == p
            out[:, here] *= power[:, None]
    return out


def _forward_choice(M: np.ndarray, y: np.ndarray, most: int, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """Choose columns one by one by the variance that they explain beyond those before; return them and the fit."""
    left, total = M.copy(), float(y @ y)
    size = np.einsum("nk,nk->k", M, M)
    residual = y.copy()
    chosen: list[int] = []
    for _ in range(min(most, M.shape[1])):
        norms = np.einsum("nk,nk->k", left, left)
        usable = norms > 1e-10 * np.maximum(size, 1e-300)
        usable[chosen] = False
        if not usable.any():
            break
        gains = np.where(usable, (left.T @ residual) ** 2 / np.where(usable, norms, 1.0), 0.0)
        best = int(np.argmax(gains))
        if chosen and gains[best] < threshold * max(total, 1e-300):
            break
        chosen.append(best)
        direction = left[:, best] / np.sqrt(norms[best])
        residual = residual - direction * (direction @ residual)
        left -= np.outer(direction, direction @ left)
    return np.array(chosen), np.linalg.lstsq(M[:, chosen], y, rcond=None)[0]

r"""Recursive estimate of a few parameters: a Kalman filter over blocks of samples, with filterpy behind this module.

A block of samples y = H θ + v is first reduced by a QR factorisation to as many rows as there are parameters, which
loses nothing: the filter's update then costs the same for twenty samples as for one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

GATE = 6.0
"""Standard deviations beyond which a sample is an outlier."""

SURPRISE = 0.5
"""Share of outliers in a block above which they are no outliers but a change."""


class RecursiveEstimate:
    r"""Follow parameters that drift slowly.

    .. math:: \theta_{k+1} = \theta_k, \quad P_{k+1|k} = \lambda^{-B} P_k \le P_0, \qquad y_k = H_k\theta_k + v_k

    with the forgetting factor λ a sample, blocks of B samples, and the covariance never above the prior's.

    Parameters
    ----------
    value : array, shape (n_parameters,)
        Where the parameters start.
    spread : array, shape (n_parameters,)
        Their standard deviations before any sample, in their own units; also the largest that forgetting leads to.
    memory : float
        Samples after which a sample counts 1/e; infinite for none forgotten.
    covariance : array, shape (n_parameters, n_parameters), optional
        Covariance to go on from; that of the spread by default.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.online import RecursiveEstimate
    >>> estimate = RecursiveEstimate([0.0], [10.0], memory=np.inf)
    >>> kept = estimate.update(np.ones((50, 1)), np.full(50, 2.0), noise=0.1)
    >>> round(float(estimate.value[0]), 3)
    2.0
    """

    def __init__(self, value: Any, spread: Any, memory: float, covariance: np.ndarray | None = None) -> None:
        from filterpy.kalman import KalmanFilter

        value = np.asarray(value, dtype=float)
        self.limit = np.asarray(spread, dtype=float)
        self.memory = float(memory)
        n = len(value)
        self._filter = KalmanFilter(dim_x=n, dim_z=n)
        self._filter.x = value[:, None].copy()
        self._filter.P = np.diag(self.limit**2) if covariance is None else np.array(covariance, dtype=float)
        self._filter.F = np.eye(n)
        self._filter.Q = np.zeros((n, n))
        self._filter.R = np.eye(n)

    @property
    def value(self) -> np.ndarray:
        """The parameters, shape (n_parameters,)."""
        return self._filter.x[:, 0].copy()

    @value.setter
    def value(self, value: np.ndarray) -> None:
        self._filter.x = np.asarray(value, dtype=float)[:, None].copy()

    @property
    def covariance(self) -> np.ndarray:
        """Their covariance, shape (n_parameters, n_parameters)."""
        return self._filter.P.copy()

    @property
    def uncertainty(self) -> np.ndarray:
        """Their standard deviations, shape (n_parameters,)."""
        return np.sqrt(np.diag(self._filter.P))

    def update(self, H: np.ndarray, y: np.ndarray, noise: float) -> np.ndarray:
        """Take a block of samples.

        Parameters
        ----------
        H : array, shape (n_samples, n_parameters)
            What each parameter contributes to each sample.
        y : array, shape (n_samples,)
            Measured values; NaN where there is none.
        noise : float
            Standard deviation of a sample.

        Returns
        -------
        array of bool, shape (n_samples,)
            Which samples counted.
        """
        kalman = self._filter
        n = len(self.limit)
        kalman.alpha = 1.0 if np.isinf(self.memory) else float(np.exp(0.5 * len(y) / self.memory))
        kalman.predict()
        # Forgetting without news would let the covariance grow without end.
        shrink = np.minimum(1.0, self.limit / np.sqrt(np.diag(kalman.P)))
        if shrink.min() < 1.0:
            kalman.P = kalman.P * shrink[:, None] * shrink
        with np.errstate(invalid="ignore"):
            innovation = y - H @ kalman.x[:, 0]
            expected = np.sqrt(noise**2 + np.einsum("ij,jk,ik->i", H, kalman.P, H))
            known = np.isfinite(innovation)
            kept = known & (np.abs(innovation) <= GATE * expected)
        if kept.sum() < SURPRISE * known.sum():
            kept = known
        if not kept.any():
            return kept
        rows = np.column_stack([H[kept], y[kept]]) / noise
        if len(rows) <= n:
            rows = np.vstack([rows, np.zeros((n + 1 - len(rows), n + 1))])
        R = np.asarray(np.linalg.qr(rows, mode="r"))
        kalman.update(R[:n, n:], H=R[:n, :n])
        return kept

r"""Recursive estimate of a few parameters: a Kalman filter over blocks of samples, with filterpy behind this module.

A block of samples y = H θ + v is first reduced by a QR factorisation to as many rows as there are parameters, which
loses nothing: the filter's update then costs the same for twenty samples as for one.

Parameters drift, which forgetting follows, and they jump: another muscle, a broken spring. A memory of M samples says
that about one change comes in so many, hence the odds of one in a block of B are B/M. A block is suspect where its
innovations are likelier after a jump than without one by more than these odds; if the next block agrees, the covariance
grows by the jump that makes both likeliest, and otherwise the suspect block was a disturbance and is left out (after
P. J. Harrison, C. F. Stevens, "Bayesian forecasting", Journal of the Royal Statistical Society B 38(3), 1976.
https://doi.org/10.1111/j.2517-6161.1976.tb01586.x). What is likely depends on the noise, which a short healthy stretch
tells badly; it is learnt on from what blocks leave within themselves, which no jump between them changes.
"""

from typing import Any

import numpy as np

GATE = 6.0
"""Standard deviations beyond which a sample is an outlier."""

SURPRISE = 0.5
"""Share of outliers in a block above which they are a change."""

JUMPS = 0.25 ** np.arange(16.0)
"""Variances of a jump among which the likeliest is taken, in units of the prior's: a factor of two in size apart."""


class RecursiveEstimate:
    r"""Follow parameters that drift slowly.

    .. math:: \theta_{k+1} = \theta_k, \quad P_{k+1|k} = \lambda^{-B} P_k \le P_0, \qquad y_k = H_k\theta_k + v_k

    with the forgetting factor λ per sample, blocks of B samples, and the covariance never above the prior's.

    Parameters
    ----------
    value : array, shape (n_parameters,)
        Where the parameters start.
    spread : array, shape (n_parameters,)
        Their standard deviations before any sample, in their own units; also the largest that forgetting leads to.
    memory : float
        Samples after which a sample counts 1/e; infinite for none forgotten.
    covariance : array, shape (n_parameters, n_parameters), optional
        Covariance to continue from; that of the spread by default.
    suspect : array, shape (n_rows, n_parameters + 1), optional
        Reduced rows of a suspect block to continue from; none by default.
    scatter : array, shape (2,), optional
        Squares that blocks leave within themselves, in units of the noise that `update` is given, and their degrees of
        freedom, from which the noise is estimated further; by default the noise is known.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.online import RecursiveEstimate
    >>> estimate = RecursiveEstimate([0.0], [10.0], memory=np.inf)
    >>> kept = estimate.update(np.ones((50, 1)), np.full(50, 2.0), noise=0.1)
    >>> round(float(estimate.value[0]), 3)
    2.0
    """

    def __init__(
        self,
        value: Any,
        spread: Any,
        memory: float,
        covariance: np.ndarray | None = None,
        suspect: np.ndarray | None = None,
        scatter: np.ndarray | None = None,
    ) -> None:
        from filterpy.kalman import KalmanFilter

        value = np.asarray(value, dtype=float)
        self.limit = np.asarray(spread, dtype=float)
        self.memory = float(memory)
        n = len(value)
        self.suspect = np.empty((0, n + 1)) if suspect is None else np.array(suspect, dtype=float)
        self.scatter = None if scatter is None else np.array(scatter, dtype=float)
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
        """Take a block of samples and return which of them were used.

        H, shape (n_samples, n_parameters), is what each parameter contributes to each sample; a measured value may be
        NaN; the noise is the standard deviation of a sample, or what it was when the scatter began.
        """
        kalman = self._filter
        n = len(self.limit)
        if self.scatter is not None:
            noise = noise * float(np.sqrt(self.scatter[0] / self.scatter[1]))
        kalman.alpha = 1.0 if np.isinf(self.memory) else float(np.exp(0.5 * len(y) / self.memory))
        kalman.predict()
        # Forgetting without new information would let the covariance grow without bound.
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
        triangle = _triangle(np.column_stack([H[kept], y[kept]]) / noise)
        self._learn_noise(triangle[n, n], int(kept.sum()) - n, len(y))
        R = self._with_suspect(triangle[:n], len(y))
        if R is not None:
            kalman.update(R[:, n:], H=R[:, :n])
        return kept

    def _learn_noise(self, left: float, freedom: int, samples: int) -> None:
        """Take in the residual of a block within itself, for any parameters."""
        if self.scatter is None or freedom <= 0:
            return
        present = self.scatter[0] / self.scatter[1]
        self.scatter = np.exp(-samples / self.memory) * self.scatter + [present * left**2, freedom]

    def _with_suspect(self, rows: np.ndarray, samples: int) -> np.ndarray | None:
        """Return the rows to update with, the covariance grown where they jump; None where they are put off."""
        before, self.suspect = self.suspect, self.suspect[:0]
        if self._jump(rows, samples) == 0.0:
            return rows
        both = _triangle(np.vstack([before, rows]))[: len(self.limit)]
        size = self._jump(both, samples) if len(before) else 0.0
        if size == 0.0:
            self.suspect = rows
            return None
        self._filter.P = self._filter.P + size * np.diag(self.limit**2)
        return both

    def _jump(self, rows: np.ndarray, samples: int) -> float:
        """Return the likeliest variance of a jump, in units of the prior's; 0 where none is likelier than its odds."""
        n, limit = len(self.limit), max(np.log(self.memory / samples), 0.0)
        R, innovation = rows[:, :n], rows[:, n] - rows[:, :n] @ self.value
        still = R @ self._filter.P @ R.T + np.eye(n)
        if np.isinf(limit) or 0.5 * innovation @ np.linalg.solve(still, innovation) <= limit:
            return 0.0
        jumped = still + JUMPS[:, None, None] * ((R * self.limit**2) @ R.T)
        every = np.concatenate([still[None], jumped])
        squares = np.linalg.solve(every, np.broadcast_to(innovation, (len(every), n))[..., None])[..., 0] @ innovation
        likelihood = -0.5 * (np.linalg.slogdet(every)[1] + squares)
        best = int(np.argmax(likelihood))
        return float(JUMPS[best - 1]) if likelihood[best] - likelihood[0] > limit else 0.0


def _triangle(rows: np.ndarray) -> np.ndarray:
    """Reduce rows (H, y) to a triangle: its first rows tell the same of the parameters, its last entry what is left."""
    n = rows.shape[1] - 1
    if len(rows) <= n:
        rows = np.vstack([rows, np.zeros((n + 1 - len(rows), n + 1))])
    return np.asarray(np.linalg.qr(rows, mode="r"))

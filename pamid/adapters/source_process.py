r"""A fresh fit that may keep some of the source: a Gaussian process on another model's prediction and the state.

.. math:: y \sim \mathcal{N}\big(0,\; a_s^2\,s\,s'
    + (a_0^2 + \textstyle\sum_k a_k^2\,c_k c_k')\,e^{-\frac12 \lVert (z - z')/\ell \rVert^2} + N\big), \qquad
    N = \sigma^2 + \textstyle\sum_r b_r^2\,r^2

with the source's prediction s, the law's coefficients c and the state z = (ε, P). The amplitudes are those of the
greatest evidence: a source that tells nothing of the target gets a_s = 0. What a smooth function of the state leaves
(lags, hysteresis) grows with the rates r of contraction and pressure, so that a sample of a fast transient counts for
less.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import minimize

from ..explained import explained_fields
from ..fitting.held_out import left_of_blocks

ROWS = 1000
"""Samples that a process is conditioned on; its cost grows with their cube."""

HYPER_ROWS = 80
"""Samples that the amplitudes and lengths are chosen on."""

SPREAD = 3.0
"""Standard deviation of the logarithm of an amplitude or a length under its prior: a factor of twenty."""

STARTS = {"source": 0.0, "level": 0.0, "length": 0.0, "noise": -3.0, "rate": -3.0}
"""Centres of the priors, logarithms; all signals are in units of their own spread."""

OPTIONS = {"maxiter": 100, "ftol": 1e-4}
"""Tolerance of the search: a hundredth of a nat, less than few samples can resolve."""

JITTER = 1e-8


@explained_fields
@dataclass(frozen=True)
class SourceRows:
    """What a process reads of some samples.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.source_process import SourceRows
    >>> rows = SourceRows(np.ones(3), np.zeros((3, 2)), np.ones((3, 1)), np.zeros((3, 2)))
    >>> rows.at(slice(2)).source
    array([1., 1.])
    """

    source: Annotated[np.ndarray, "The source's prediction, in the target's unit; shape (n_samples,)."]
    state: Annotated[np.ndarray, "Contraction and pressure (Pa, absolute); shape (n_samples, 2)."]
    factors: Annotated[
        np.ndarray,
        "Coefficients of the law that read the volume and its derivatives; columns of zeros left out; shape "
        "(n_samples, n_factors).",
    ]
    rates: Annotated[np.ndarray, "Rates of contraction (1/s) and pressure (Pa/s); shape (n_samples, 2)."]

    def at(self, index: np.ndarray | slice) -> SourceRows:
        """Return some of the samples."""
        return SourceRows(self.source[index], self.state[index], self.factors[index], self.rates[index])


@explained_fields
@dataclass(frozen=True)
class SourceProcess:
    """A Gaussian process on a source's prediction and the state, conditioned on the samples of a target.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.source_process import SourceRows, SourceProcess
    >>> P = np.linspace(1e5, 6e5, 40)
    >>> rows = SourceRows(2e-4 * P, np.column_stack([0.1 + 0 * P, P]), (P - 1e5)[:, None], np.zeros((40, 2)))
    >>> process, _ = SourceProcess.fit(rows, 5e-4 * P, np.ones(40), np.arange(40) // 10)
    >>> bool(np.allclose(process.predict(rows), 5e-4 * P, rtol=0.02))
    True
    """

    units: Annotated[
        np.ndarray,
        "Units of target, source, contraction, pressure and both rates, then of the factors; shape (6 + n_factors,).",
    ]
    centre: Annotated[np.ndarray, "Mean contraction and pressure; shape (2,)."]
    points: Annotated[np.ndarray, "States of the samples, in units of their spread; shape (n_points, 2)."]
    strengths: Annotated[
        np.ndarray, "Source and factors at the samples, in their units; shape (n_points, 1 + n_factors)."
    ]
    alpha: Annotated[np.ndarray, "Weights of the samples; shape (n_points,)."]
    logs: Annotated[
        np.ndarray,
        "Logarithms of a_s, a_0, both lengths, σ and both b, then of the a of the factors; shape (7 + n_factors,).",
    ]
    seen: Annotated[np.ndarray, "Least and greatest contraction, pressure and rates of the samples; shape (2, 4)."]

    @classmethod
    def fit(
        cls, rows: SourceRows, y: np.ndarray, weight: np.ndarray, blocks: np.ndarray, *, keep: bool = True
    ) -> tuple[SourceProcess, np.ndarray]:
        """Fit amplitudes and lengths by evidence; return the process and its prediction of each held-out block."""
        units = np.array(
            [_rms(v) for v in (y, rows.source)]
            + [float(np.std(v)) or 1.0 for v in rows.state.T]
            + [_rms(v) for v in (*rows.rates.T, *rows.factors.T)]
        )
        centre = rows.state.mean(axis=0)
        z, strengths, rates = _scaled(rows, units, centre)
        strengths[:, 0] *= keep
        t, noise = y / units[0], 1.0 / (weight / weight.mean())
        some = np.linspace(0, len(y) - 1, min(len(y), HYPER_ROWS)).round().astype(int)
        start = np.array(
            [STARTS[k] for k in ("source", "level", "length", "length", "noise", "rate", "rate")]
            + [STARTS["level"]] * (strengths.shape[1] - 1)
        )
        evidence = _evidence(z[some], strengths[some], rates[some], t[some], noise[some], start)
        found = minimize(
            evidence, start, jac=True, method="L-BFGS-B", bounds=[(-8.0, 6.0)] * len(start), options=OPTIONS
        )
        logs = np.asarray(found.x)
        A = _kernel(z, strengths, z, strengths, logs)
        A[np.diag_indices(len(A))] += _noise(noise, rates, logs)
        inverse = cho_solve(cho_factor(A, lower=True), np.eye(len(A)))
        alpha = inverse @ t
        held_out = y - units[0] * left_of_blocks(inverse, t, blocks)
        moved = np.column_stack([rows.state, rows.rates])
        return cls(units, centre, z, strengths, alpha, logs, np.stack([moved.min(axis=0), moved.max(axis=0)])), held_out

    def predict(self, rows: SourceRows) -> np.ndarray:
        """Return the mean at some samples, in the target's unit, shape (n_samples,)."""
        z, strengths, _ = _scaled(rows, self.units, self.centre)
        return np.asarray(self.units[0] * (_kernel(z, strengths, self.points, self.strengths, self.logs) @ self.alpha))

    def known(self, rows: SourceRows) -> np.ndarray:
        """Return the nearness of samples to those of the fit: 1 within their range, falling with the distance."""
        moved = np.column_stack([rows.state, rows.rates])
        beyond = np.maximum(self.seen[0] - moved, 0.0) + np.maximum(moved - self.seen[1], 0.0)
        return np.asarray(np.exp(-0.5 * np.sum(np.square(beyond / self.units[2:6]), axis=1)))

    def from_source(self, rows: SourceRows) -> np.ndarray:
        """Return the part of the mean that is the source's prediction times a number."""
        factor = np.exp(2.0 * self.logs[0]) * float(self.strengths[:, 0] @ self.alpha)
        return np.asarray(self.units[0] * factor * rows.source / self.units[1])


def _rms(v: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(v)))) or 1.0


def _scaled(rows: SourceRows, units: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    strengths = np.column_stack([rows.source / units[1], rows.factors / units[6:]])
    return (rows.state - centre) / units[2:4], strengths, rows.rates / units[4:6]


def _kernel(
    z: np.ndarray, strengths: np.ndarray, points: np.ndarray, others: np.ndarray, logs: np.ndarray
) -> np.ndarray:
    a = np.exp(2.0 * logs)
    near = np.exp(-0.5 * _squares(z / np.exp(logs[2:4]), points / np.exp(logs[2:4])).sum(axis=0))
    level = a[1] + (strengths[:, 1:] * a[7:]) @ others[:, 1:].T
    return np.asarray(a[0] * np.outer(strengths[:, 0], others[:, 0]) + level * near)


def _squares(z: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the squared distance along each axis, shape (2, n, m)."""
    return np.stack([np.subtract.outer(a, b) ** 2 for a, b in zip(z.T, points.T, strict=True)])


def _noise(noise: np.ndarray, rates: np.ndarray, logs: np.ndarray) -> np.ndarray:
    a = np.exp(2.0 * logs)
    return np.asarray(a[4] * noise + rates**2 @ a[5:7] + JITTER)


def _evidence(
    z: np.ndarray, strengths: np.ndarray, rates: np.ndarray, t: np.ndarray, noise: np.ndarray, start: np.ndarray
) -> Callable[[np.ndarray], tuple[float, np.ndarray]]:
    """Return the negative logarithm of evidence times prior, with its gradient, as a function of the logarithms."""
    apart, eye = _squares(z, z), np.eye(len(t))
    s, c = strengths[:, 0], strengths[:, 1:]

    def value(logs: np.ndarray) -> tuple[float, np.ndarray]:
        a, square = np.exp(2.0 * logs), np.exp(-2.0 * logs[2:4])
        near = np.exp(-0.5 * np.tensordot(square, apart, 1))
        level = (a[1] + (c * a[7:]) @ c.T) * near
        A = a[0] * np.outer(s, s) + level
        A[np.diag_indices(len(A))] += _noise(noise, rates, logs)
        try:
            factor = cho_factor(A, lower=True)
        except LinAlgError:
            return 1e10, np.zeros_like(logs)
        inverse = cho_solve(factor, eye)
        alpha = inverse @ t
        pull = (logs - start) / SPREAD
        total = 0.5 * t @ alpha + np.log(np.diagonal(factor[0])).sum() + 0.5 * pull @ pull
        W = inverse - np.outer(alpha, alpha)
        close, diagonal = W * near, np.diagonal(W)
        by = np.concatenate(
            [
                [a[0] * (s @ W @ s), a[1] * close.sum()],
                0.5 * square * np.tensordot(apart, W * level, 2),
                [a[4] * (diagonal @ noise)],
                a[5:7] * (diagonal @ rates**2),
                a[7:] * np.einsum("ik,ij,jk->k", c, close, c, optimize=True),
            ]
        )
        return float(total), by + pull / SPREAD

    return value

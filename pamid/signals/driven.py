"""Rates of signals that a known input drives: the input takes the jumps of the rate, a smoother takes the rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import NonFiniteError, ShapeError
from .rates import differentiate, tune_cutoff

_ROUNDS = 3
"""Rounds of cut-off and gains by turns; both have settled after two."""

_LIKELIHOOD = "kalman"
"""The smoother whose remainder weighs the gains: the posterior mean of a smooth signal, so that they are those of the
greatest likelihood. A moving window is not one, and led to gains 14 % off."""


def held_integral(inputs: Any, t: Any) -> np.ndarray:
    """Integrate inputs that hold from each sample to the next.

    Parameters
    ----------
    inputs : array_like, shape (n_samples, n_inputs)
        Inputs, any unit.
    t : array_like, shape (n_samples,)
        Times, s.

    Returns
    -------
    ndarray, shape (n_samples, n_inputs)
        Their integrals from the first sample, unit of the input times s.

    Examples
    --------
    >>> from pamid.signals.driven import held_integral
    >>> held_integral([[1.0], [3.0], [0.0]], [0.0, 0.1, 0.2]).ravel().round(6)
    array([0. , 0.1, 0.4])
    """
    g, t = np.asarray(inputs, dtype=float), np.asarray(t, dtype=float)
    return np.concatenate([np.zeros((1, g.shape[1])), np.cumsum(g[:-1] * np.diff(t)[:, None], axis=0)])


def fit_gains(
    signals: Sequence[Any],
    inputs: Sequence[Any],
    times: Sequence[Any],
    *,
    method: str = "savgol",
    tuning: str | float = "auto",
) -> tuple[np.ndarray, float]:
    r"""Identify how strongly inputs drive a signal, and how much the rest of it asks to be smoothed.

    .. math:: \dot y = \sum_j \beta_j\,g_j(t) + s(t), \qquad
        \hat\beta = \arg\min_\beta\; (y - G\beta)^T (I - H) (y - G\beta)

    with inputs g that hold from a sample to the next, their integrals G and a smooth remainder s. H is the Kalman/RTS
    smoother, the posterior mean of a smooth signal in white noise, which makes β the maximum-likelihood estimate;
    cut-off and β are found by turns. The method then smooths what the inputs leave.

    Parameters
    ----------
    signals : sequence of array_like, shape (n_samples,)
        The signal, one array a trajectory.
    inputs : sequence of array_like, shape (n_samples, n_inputs)
        Its inputs, likewise.
    times : sequence of array_like, shape (n_samples,)
        Times, s, likewise.
    method : {"savgol", "spline", "kalman"}, default="savgol"
        The smoother.
    tuning : "auto" or float, default="auto"
        Cut-off frequency, Hz, for what the inputs leave; "auto" chooses it, by turns with the gains.

    Returns
    -------
    gains : ndarray, shape (n_inputs,)
        β, unit of the signal per s and unit of the input; 0 for an input that never changes.
    cutoff : float
        Cut-off frequency, Hz.

    Raises
    ------
    ShapeError, NonFiniteError
        If inputs are not one row a sample, or not finite.

    References
    ----------
    R. Kohn, C. F. Ansley, "A new algorithm for spline smoothing based on smoothing a stochastic process", SIAM Journal
    on Scientific and Statistical Computing 8(1), 1987. https://doi.org/10.1137/0908004

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.driven import fit_gains, held_integral
    >>> rng, t = np.random.default_rng(0), np.arange(0, 2, 1e-3)
    >>> u = np.where(t < 1, 0.0, 1.0)[:, None]  # a command that jumps
    >>> y = np.sin(3 * t) + 5.0 * held_integral(u, t)[:, 0] + 1e-4 * rng.standard_normal(t.size)
    >>> gains, cutoff = fit_gains([y], [u], [t])
    >>> bool(abs(gains[0] - 5.0) < 0.1)
    True
    """
    clocks = [np.asarray(t, dtype=float) for t in times]
    runs = [np.asarray(y, dtype=float) for y in signals]
    drives = [_checked(g, len(y)) for y, g in zip(runs, inputs, strict=True)]
    changes = np.ptp(np.concatenate(drives), axis=0) > 0
    integrals = [held_integral(g * changes, t) for g, t in zip(drives, clocks, strict=True)]
    gains = np.zeros(integrals[0].shape[1])

    def cutoff_of_rest(method: str) -> float:
        rest = [y - G @ gains for y, G in zip(runs, integrals, strict=True)]
        return tune_cutoff(rest, clocks, method=method)

    automatic = isinstance(tuning, str)
    for _ in range(_ROUNDS if automatic else 1):
        cutoff = cutoff_of_rest(_LIKELIHOOD) if automatic else float(tuning)
        gains = _likeliest_gains(runs, integrals, clocks, cutoff)
    return gains, cutoff_of_rest(method) if automatic else float(tuning)


def _likeliest_gains(
    runs: Sequence[np.ndarray], integrals: Sequence[np.ndarray], clocks: Sequence[np.ndarray], cutoff: float
) -> np.ndarray:
    """Solve the normal equations (Gᵀ (I − H) G) β = Gᵀ (I − H) y over all trajectories."""
    n = integrals[0].shape[1]
    normal, right = np.zeros((n, n)), np.zeros(n)
    for y, G, t in zip(runs, integrals, clocks, strict=True):
        left = G - differentiate(G, t, method=_LIKELIHOOD, tuning=cutoff, warn=False)[0]
        normal += G.T @ left
        right += left.T @ (y - y.mean())
    scale = np.sqrt(np.maximum(np.diag(normal), 0.0))
    scale = np.where(scale > 0, scale, 1.0)
    normal = (normal + normal.T) / 2.0 / np.outer(scale, scale)
    return np.linalg.lstsq(normal, right / scale, rcond=1e-9)[0] / scale


def differentiate_driven(
    y: Any, inputs: Any, t: Any, gains: Any, *, cutoff: float, method: str = "savgol"
) -> tuple[np.ndarray, np.ndarray]:
    """Smooth one trajectory of a driven signal and give its rate, from the instant of each sample on.

    Parameters
    ----------
    y : array_like, shape (n_samples,)
        Signal, any unit.
    inputs : array_like, shape (n_samples, n_inputs)
        What drives it, each held from a sample to the next.
    t : array_like, shape (n_samples,)
        Times, s, increasing.
    gains : array_like, shape (n_inputs,)
        See `fit_gains`.
    cutoff : float
        Cut-off frequency, Hz, for what the inputs leave.
    method : {"savgol", "spline", "kalman"}, default="savgol"
        The smoother.

    Returns
    -------
    smoothed : ndarray, shape (n_samples,)
        The smoothed signal, unit of y.
    rate : ndarray, shape (n_samples,)
        Its rate, unit of y per s; where an input jumps, the one after the jump.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals.driven import differentiate_driven
    >>> t = np.arange(0, 1, 1e-2)
    >>> u = np.where(t < 0.5, 0.0, 2.0)[:, None]
    >>> y = np.maximum(t - 0.5, 0.0) * 2.0  # starts to rise at once
    >>> smoothed, rate = differentiate_driven(y, u, t, [1.0], cutoff=5.0)
    >>> rate[[49, 50, 51]].round(3).tolist()
    [0.0, 2.0, 2.0]
    """
    y, t, gains = (np.asarray(v, dtype=float) for v in (y, t, gains))
    g = _checked(inputs, len(y))
    driven = held_integral(g, t) @ gains
    smoothed, rate = differentiate(y - driven, t, method=method, tuning=cutoff, warn=False)
    return smoothed + driven, rate + g @ gains


def _checked(inputs: Any, n: int) -> np.ndarray:
    g = np.asarray(inputs, dtype=float)
    if g.ndim != 2 or len(g) != n:
        raise ShapeError(f"inputs have the shape {g.shape} for {n} samples.", "(n_samples, n_inputs)", "Reshape them.")
    if not np.isfinite(g).all():
        row, column = np.argwhere(~np.isfinite(g))[0]
        raise NonFiniteError(
            f"Input {column} is NaN or infinite in row {row + 1}.", "finite inputs", "Fill in or drop these rows first."
        )
    return g

r"""Free runs of a model that gives an output's next step from its own past and that of the inputs.

With scaled lags :math:`\varphi_k = (z_{k-1}, \dots, z_{k-p}, u_k, \dots, u_{k-q+1})`,

.. math:: z_k = z_{k-1} + s\,f(\theta, \varphi_k),

where each z on the right is the model's own. Runs go side by side: one step of all of them is one call of the model.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .marquardt import Normal

_FAR = 20.0  # standard deviations at which a run is held while a fit looks for better parameters


class StepModel(NamedTuple):
    """The function of the lags."""

    value: Callable[[np.ndarray, np.ndarray], np.ndarray]
    """Parameters and scaled lags (n, n_lags) to the scaled step (n,)."""
    derivatives: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
    """The same to the step (n,), ∂step/∂φ (n, n_lags) and ∂step/∂θ (n, n_parameters)."""


class Segments(NamedTuple):
    """Stretches of equal length that run side by side."""

    inputs: np.ndarray
    """Lagged inputs, shape (n_segments, length, n_input_lags)."""
    wanted: np.ndarray
    """Outputs, shape (n_segments, length)."""
    before: np.ndarray
    """Outputs before the first row, the latest first. Shape (n_segments, n_output_lags)."""
    counts: np.ndarray
    """1 where a row belongs to the segment, 0 where it fills up. Shape (n_segments, length)."""


def input_lags(u: np.ndarray, slices: list[slice], lags: int, delay: int = 0) -> np.ndarray:
    """Inputs of `delay` rows before and of those before that, the first held at the start: (n, lags · n_inputs)."""
    rows, first = np.arange(len(u)), _first_rows(slices)
    return np.concatenate([u[np.maximum(rows - k, first)] for k in range(delay, delay + lags)], axis=1)


def output_lags(z: np.ndarray, slices: list[slice], lags: int) -> np.ndarray:
    """Outputs of the rows before a row, the latest first, the first held before the start: (n, lags)."""
    rows, first = np.arange(len(z)), _first_rows(slices)
    return np.stack([z[np.maximum(rows - k, first)] for k in range(1, lags + 1)], axis=1)


def segments(inputs: np.ndarray, z: np.ndarray, past: np.ndarray, slices: list[slice], length: int) -> Segments:
    """Cut runs into stretches of at most `length` rows."""
    starts = np.concatenate([np.arange(s.start, s.stop, length) for s in slices])
    stops = np.concatenate([np.full(len(range(s.start, s.stop, length)), s.stop) for s in slices])
    table = starts[:, None] + np.arange(min(length, max(s.stop - s.start for s in slices)))
    counts = table < stops[:, None]
    table = np.minimum(table, stops[:, None] - 1)
    return Segments(inputs[table], z[table], past[starts], counts.astype(float))


def squared_error(model: StepModel, theta: np.ndarray, stretches: Segments, scale: float) -> float:
    """Return the sum of squares of free runs over the stretches; a run that goes astray is held."""
    past, total = stretches.before.copy(), 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(stretches.wanted.shape[1]):
            phi = np.concatenate([past, stretches.inputs[:, k]], axis=1)
            z = np.clip(past[:, 0] + scale * model.value(theta, phi), -_FAR, _FAR)
            total += float(np.sum(stretches.counts[:, k] * (z - stretches.wanted[:, k]) ** 2))
            past = np.concatenate([z[:, None], past[:, :-1]], axis=1)
    return total


def normal_equations(model: StepModel, theta: np.ndarray, stretches: Segments, scale: float) -> Normal:
    """Loss, gradient and Gauss–Newton matrix of free runs, by carrying ∂y/∂θ along."""
    past = stretches.before.copy()
    n_past, size = past.shape[1], len(theta)
    carried = np.zeros((len(past), n_past, size))
    loss, gradient, matrix = 0.0, np.zeros(size), np.zeros((size, size))
    for k in range(stretches.wanted.shape[1]):
        phi = np.concatenate([past, stretches.inputs[:, k]], axis=1)
        f, to_phi, to_theta = model.derivatives(theta, phi)
        bare = past[:, 0] + scale * f
        z = np.clip(bare, -_FAR, _FAR)
        share = to_theta
        if k:
            share = share + np.einsum("ni,nip->np", to_phi[:, :n_past], carried)
        J = carried[:, 0] + scale * share
        J[z != bare] = 0.0  # a run that is held no longer answers to the parameters
        counts = stretches.counts[:, k]
        r = counts * (z - stretches.wanted[:, k])
        loss += float(r @ r)
        gradient += J.T @ r
        weighed = counts[:, None] * J
        matrix += weighed.T @ weighed
        past = np.concatenate([z[:, None], past[:, :-1]], axis=1)
        carried = np.concatenate([J[:, None], carried[:, :-1]], axis=1)
    return Normal(loss, gradient, matrix)


def free_run(
    model: StepModel,
    theta: np.ndarray,
    lags: np.ndarray,
    past: np.ndarray,
    slices: list[slice],
    scale: float,
    bounds: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Run all runs side by side."""
    low, high = bounds
    y, held = np.empty(len(lags)), np.zeros(len(lags), dtype=bool)
    lengths = np.array([s.stop - s.start for s in slices])
    order = np.argsort(-lengths, kind="stable")
    first = np.array([s.start for s in slices])[order]
    past, longest_first, active = past[order], lengths[order], len(order)
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(int(longest_first[0])):
            while longest_first[active - 1] <= k:
                active -= 1
            rows = first[:active] + k
            past = past[:active]
            z = past[:, 0] + scale * model.value(theta, np.concatenate([past, lags[rows]], axis=1))
            inside = np.clip(np.nan_to_num(z, nan=high, posinf=high, neginf=low), low, high)
            held[rows] = inside != z
            y[rows] = inside
            past = np.concatenate([inside[:, None], past[:, :-1]], axis=1)
    return y, held


def _first_rows(slices: list[slice]) -> np.ndarray:
    return np.concatenate([np.full(s.stop - s.start, s.start) for s in slices])

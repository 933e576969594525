"""Subspace identification of linear models over several runs, and their free runs."""

from typing import NamedTuple

import numpy as np

_EDGE = 1.0 - 1e-6  # largest pole: a free run must not diverge


class Realisation(NamedTuple):
    """A linear model of one order in standardised signals, and how it does."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    """The matrices; C and D are those of one output, as vectors."""
    offset: float
    """What is added to the output."""
    covariance: np.ndarray
    """Covariance of the states over the runs."""
    loss: float
    """Mean squared error of free runs from fitted first states."""
    correlation: float
    """Canonical correlation of past and future that the last state carries."""
    criterion: float
    """Squares of the correlations left out, and for each that is kept what chance alone would give."""


def realisations(u: np.ndarray, z: np.ndarray, slices: list[slice], rows: int, most: int) -> list[Realisation]:
    """Return the models of order 1 to `most`."""
    U, s, count = projection(u, z, slices, rows)
    edge = chance_edge(rows, rows * (u.shape[1] + 1), count)
    return [_realised(U[:, :n], s, edge, u, z, slices) for n in range(1, min(most, len(s)) + 1)]


def chance_edge(p: int, q: int, count: int) -> float:
    """Return the largest squared canonical correlation of p and q unrelated signals in so many samples (Wachter)."""
    a, b = min(p / count, 1.0), min(q / count, 1.0)
    return float(min(1.0, (np.sqrt(a * (1.0 - b)) + np.sqrt(b * (1.0 - a))) ** 2))


def projection(u: np.ndarray, z: np.ndarray, slices: list[slice], rows: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Return directions and canonical correlations of past and future outputs less future inputs, and the columns."""
    parts = []
    for run in slices:
        n = run.stop - run.start - 2 * rows + 1
        if n < 1:
            continue
        at = run.start + np.arange(n)[:, None] + np.arange(2 * rows)
        past, ahead = at[:, :rows], at[:, rows:]
        flat = [np.ones((n, 1)), u[ahead].reshape(n, -1), u[past].reshape(n, -1), z[past], z[ahead]]
        parts.append(np.concatenate(flat, axis=1))
    data = np.concatenate(parts)
    R = np.asarray(np.linalg.qr(data, mode="r")).T  # the lower factor of the data, one row per signal
    first = 1 + rows * u.shape[1]  # a constant is no state
    second = first + rows * (u.shape[1] + 1)
    told, left = R[second:, first:second], R[second:, first:]
    power = left @ left.T
    size = np.linalg.cholesky(power + 1e-12 * np.trace(power) / len(power) * np.eye(len(power)))
    U, s, _ = np.linalg.svd(np.linalg.solve(size, told), full_matrices=False)
    return size @ U, np.minimum(s, 1.0), len(data)


def _realised(
    gamma: np.ndarray, s: np.ndarray, edge: float, u: np.ndarray, z: np.ndarray, slices: list[slice]
) -> Realisation:
    n = gamma.shape[1]
    gamma = gamma * np.sqrt(s[:n])
    A = _inside(np.linalg.lstsq(gamma[:-1], gamma[1:], rcond=None)[0])
    C, m = gamma[0].copy(), u.shape[1]
    # y is linear in B, D, a constant and the first states: one column for each of their numbers.
    own = n * m + m + 1
    columns = np.zeros((len(z), own + n * len(slices)))
    columns[:, n * m : own] = np.column_stack([u, np.ones(len(u))])
    for k, run in enumerate(slices):
        length = run.stop - run.start
        columns[run, : n * m] = _responses(A, C, u[run])
        free = np.empty((length, n))
        row = C.copy()
        for t in range(length):
            free[t] = row
            row = row @ A
        columns[run, own + k * n : own + (k + 1) * n] = free
    found = np.linalg.lstsq(columns, z, rcond=1e-10)[0]
    residual = z - columns @ found
    B, D, offset = found[: n * m].reshape(n, m), found[n * m : own - 1], float(found[own - 1])
    loss = float(np.mean(np.square(residual)))
    states = np.concatenate(
        [_states(A, B, found[own + k * n : own + (k + 1) * n], u[run]) for k, run in enumerate(slices)]
    )
    criterion = float(np.sum(np.square(s[n:])) + n * edge)
    covariance = np.atleast_2d(np.cov(states.T)) if len(states) > 1 else np.eye(n)
    return Realisation(A, B, C, D, offset, covariance, loss, float(s[n - 1]), criterion)


def _inside(A: np.ndarray) -> np.ndarray:
    """Move poles outside the unit circle onto its edge."""
    values, vectors = np.linalg.eig(A)
    size = np.abs(values)
    if np.all(size <= _EDGE):
        return A
    values = np.where(size > _EDGE, values * (_EDGE / np.maximum(size, _EDGE)), values)
    return np.asarray(np.real(vectors @ np.diag(values) @ np.linalg.pinv(vectors)))


def _responses(A: np.ndarray, C: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the output to each input through each state alone: (n_samples, n_states * n_inputs)."""
    n, m = len(A), u.shape[1]
    out, x = np.empty((len(u), n * m)), np.zeros((n, n * m))
    eye = np.eye(n)
    for t in range(len(u)):
        out[t] = C @ x
        x = A @ x + (eye[:, :, None] * u[t]).reshape(n, n * m)
    return out


def _states(A: np.ndarray, B: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    out, driven = np.empty((len(u), len(A))), u @ B.T
    for t in range(len(u)):
        out[t] = x
        x = A @ x + driven[t]
    return out


def simulated(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the output of a free run from a first state."""
    return np.asarray(_states(A, B, x, u) @ C + u @ D)


def steady(A: np.ndarray, B: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the state at rest under an input; that of least size where there are many."""
    return np.asarray(np.linalg.lstsq(np.eye(len(A)) - A, B @ u, rcond=1e-9)[0])


def gain_alone(u: np.ndarray, z: np.ndarray) -> Realisation:
    """Return the model of runs too short for any dynamics: a gain."""
    D = np.linalg.lstsq(u, z, rcond=None)[0]
    loss = float(np.mean(np.square(z - u @ D)))
    empty = np.zeros((1, 1))
    return Realisation(empty, np.zeros((1, u.shape[1])), np.zeros(1), D, 0.0, np.eye(1), loss, 0.0, 0.0)

"""A network of one hidden layer in numpy with its exact Jacobian, fitted by Levenberg–Marquardt.

M. T. Hagan, M. B. Menhaj, "Training feedforward networks with the Marquardt algorithm", IEEE Transactions on Neural
Networks 5(6), 1994. https://doi.org/10.1109/72.329697
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .marquardt import Marquardt, Normal

Weights = dict[str, np.ndarray]
CHUNK = 20_000
"""Rows whose Jacobian is held at a time."""


def initial_weights(rng: np.random.Generator, n_in: int, hidden: int, n_out: int) -> Weights:
    """Draw weights after D. Nguyen, B. Widrow, IJCNN 1990 (https://doi.org/10.1109/IJCNN.1990.137819)."""
    direction = rng.standard_normal((n_in, hidden))
    direction /= np.linalg.norm(direction, axis=0)
    steepness = 0.7 * hidden ** (1.0 / n_in) / np.sqrt(3.0)
    return {
        "W0": steepness * direction,
        "b0": steepness * np.sqrt(3.0) * np.linspace(-1.0, 1.0, hidden) * rng.choice([-1.0, 1.0], hidden),
        "W1": rng.uniform(-0.5, 0.5, (hidden, n_out)) / np.sqrt(hidden),
        "b1": np.zeros(n_out),
    }


def flatten(weights: Weights) -> np.ndarray:
    """Put all weights in one vector."""
    return np.concatenate([weights[k].ravel() for k in ("W0", "b0", "W1", "b1")])


def unflatten(flat: np.ndarray, n_in: int, hidden: int, n_out: int) -> Weights:
    """Undo `flatten`."""
    shapes = {"W0": (n_in, hidden), "b0": (hidden,), "W1": (hidden, n_out), "b1": (n_out,)}
    parts = np.split(flat, np.cumsum([int(np.prod(s)) for s in shapes.values()])[:-1])
    return {k: part.reshape(s).copy() for (k, s), part in zip(shapes.items(), parts, strict=True)}


def forward(weights: Weights, x: np.ndarray) -> np.ndarray:
    """Evaluate the network: (n, n_in) to (n, n_out)."""
    return np.asarray(np.tanh(x @ weights["W0"] + weights["b0"]) @ weights["W1"] + weights["b1"])


def forward_by_columns(weights: Weights, signals: Sequence[Any], mean: np.ndarray, scale: np.ndarray) -> list[Any]:
    """Evaluate the network on signals that may be symbols, sum by sum: standardisation and `forward` as a formula."""
    columns = [(x - m) / s for x, m, s in zip(signals, mean.tolist(), scale.tolist(), strict=True)]
    hidden = [
        np.tanh(sum((w * c for w, c in zip(row, columns, strict=True)), start=b))
        for row, b in zip(weights["W0"].T.tolist(), weights["b0"].tolist(), strict=True)
    ]
    return [
        sum((w * h for w, h in zip(row, hidden, strict=True)), start=b)
        for row, b in zip(weights["W1"].T.tolist(), weights["b1"].tolist(), strict=True)
    ]


def derivatives(weights: Weights, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return outputs (n, n_out), ∂y/∂x (n, n_out, n_in) and ∂y/∂weights (n, n_out, n_weights)."""
    a = np.tanh(x @ weights["W0"] + weights["b0"])
    n, hidden = a.shape
    n_in, n_out = x.shape[1], weights["b1"].size
    slope = 1.0 - a * a
    dx = np.empty((n, n_out, n_in))
    dw = np.zeros((n, n_out, n_in * hidden + hidden + hidden * n_out + n_out))
    for o in range(n_out):
        back = slope * weights["W1"][:, o]
        dx[:, o] = back @ weights["W0"].T
        dw[:, o, : n_in * hidden] = (x[:, :, None] * back[:, None, :]).reshape(n, -1)
        dw[:, o, n_in * hidden : (n_in + 1) * hidden] = back
        dw[:, o, (n_in + 1) * hidden + o : (n_in + 1) * hidden + hidden * n_out : n_out] = a
        dw[:, o, (n_in + 1) * hidden + hidden * n_out + o] = 1.0
    return a @ weights["W1"] + weights["b1"], dx, dw


def normal_equations(weights: Weights, x: np.ndarray, y: np.ndarray, share: np.ndarray) -> Normal:
    """Return Σ share |y − net(x)|² with its gradient and Gauss–Newton matrix, in bounded memory."""
    size = sum(w.size for w in weights.values())
    loss, gradient, matrix = 0.0, np.zeros(size), np.zeros((size, size))
    for start in range(0, len(x), CHUNK):
        part = slice(start, start + CHUNK)
        z, _, J = derivatives(weights, x[part])
        root = np.sqrt(share[part])[:, None]
        r = (root * (z - y[part])).ravel()
        J = (root[:, :, None] * J).reshape(len(r), -1)
        loss += float(r @ r)
        gradient += J.T @ r
        matrix += J.T @ J
    return Normal(loss, gradient, matrix)


def squared_error(weights: Weights, x: np.ndarray, y: np.ndarray, share: np.ndarray) -> float:
    """Return Σ share |y − net(x)|²."""
    return float(np.sum(share[:, None] * (forward(weights, x) - y) ** 2))


def marquardt_on_rows(
    weights: Weights, x: np.ndarray, y: np.ndarray, share: np.ndarray, alpha: float = 0.0, held: bool = False
) -> Marquardt:
    """Make the steps that fit a network to rows; `held`, it stays where it is as far as the rows say nothing."""
    n_in, hidden = weights["W0"].shape
    shape = (n_in, hidden, weights["b1"].size)
    return Marquardt(
        flatten(weights),
        lambda flat: normal_equations(unflatten(flat, *shape), x, y, share),
        lambda flat: squared_error(unflatten(flat, *shape), x, y, share),
        alpha,
        flatten(weights) if held else None,
    )

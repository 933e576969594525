"""Small networks, problems of training, and their derivatives by autograd."""

from __future__ import annotations

import numpy as np
import torch

from pamid.training import TrainingProblem
from pamid.training.network import (
    ACTIVATIONS,
    initial_parameters,
)

PLAIN = {
    "softplus": lambda z: torch.nn.functional.softplus(z, threshold=50),  # torch's own rounds at 20 already
    "tanh": torch.tanh,
    "silu": torch.nn.functional.silu,
}
ACTIVATION = sorted(ACTIVATIONS)
WIDTHS = [(4, 1), (4, 7, 1), (4, 6, 5, 3, 1)]


def start(widths=(4, 8, 8, 1), seed=0, dtype=torch.float64):
    return initial_parameters(widths, np.random.RandomState(seed), dtype)


def problem(n=60, seed=1, *, weighted=True, dtype=torch.float64, reads_value=True):
    """A target that a network can follow: value and slope of a smooth function, mixed by random factors."""
    rng = np.random.default_rng(seed)
    x, d, a = rng.normal(size=(n, 4)), rng.normal(size=(n, 4)), rng.normal(size=n) * reads_value
    f = np.sin(x[:, 0]) + 0.3 * x[:, 1] * x[:, 2]
    df = np.cos(x[:, 0]) * d[:, 0] + 0.3 * (d[:, 1] * x[:, 2] + x[:, 1] * d[:, 2])
    weight = rng.uniform(0.2, 3.0, n) if weighted else None
    return TrainingProblem.from_arrays(x, d, a, a * f + df, weight, dtype=dtype)


def plain_network(parameters, x, activation):
    """The network as anybody would write it, for autograd."""
    h = x
    for k in range(0, len(parameters) - 2, 2):
        h = PLAIN[activation](h @ parameters[k].T + parameters[k + 1])
    return (h @ parameters[-2].T + parameters[-1])[:, 0]


def plain_law(parameters, p, activation):
    """a N + ∂_d N by a first backward pass that can be differentiated again."""
    x = p.x.clone().requires_grad_()
    value = plain_network(parameters, x, activation)
    (slope,) = torch.autograd.grad(value.sum(), x, create_graph=True)
    a = 0.0 if p.a is None else p.a
    return a * value + (slope * p.direction).sum(1), value, (slope * p.direction).sum(1)


def plain_jacobian(parameters, p, activation):
    """J row by row, shape (n_samples, n_parameters)."""
    theta = [v.clone().requires_grad_() for v in parameters]
    y, _, _ = plain_law(theta, p, activation)
    rows = []
    for value in y:
        g = torch.autograd.grad(value, theta, retain_graph=True, allow_unused=True)
        filled = [torch.zeros_like(t) if v is None else v for v, t in zip(g, theta, strict=True)]
        rows.append(torch.cat([v.reshape(-1) for v in filled]))
    return torch.stack(rows)


def flat(parameters):
    return torch.cat([p.reshape(-1) for p in parameters])

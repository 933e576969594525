"""How strongly an adaptation should be held to its source: by what cross-validation over runs leaves.

Near the source the network is linear in its parameters, so an adaptation is a ridge regression in the space of the
samples. One Gram matrix then gives the held-out error of every strength of the pull, without training once.

Which strength comes out best varies from draw to draw, as some runs tell little of it. How much error is left
at the best one varies little; with a prior on how far a weight moves, that gives a strength which can be relied on.
"""

import numpy as np
import torch

from ..fitting.held_out import left_of_blocks
from .network import Parameters, adjoints, forward
from .problem import TrainingProblem
from .reparametrisation import Reparametrisation

STRENGTHS = tuple(10.0 ** (k / 2.0) for k in range(-16, 5))
"""Candidates for λ, relative to the mean squared residual in units of the target's variance."""

ROWS = 1000
"""Samples that the choice is made on; its cost grows with their cube."""

FOLDS = 5

MOVE = 0.14
"""Standard deviation of what a weight moves by from one muscle to another: as much as initial weights scatter."""


def choose_weight_decay(
    problem: TrainingProblem,
    psi: Parameters,
    activation: str,
    adapter: Reparametrisation,
    trajectories: np.ndarray,
    random_state: np.random.RandomState,
) -> float:
    r"""Return the weight decay :math:`\lambda = e/(n\,\tau^2)`, e the least held-out error of `STRENGTHS`, τ = `MOVE`.

    Linear folds leave :math:`r_\mathrm{out} - K_\mathrm{out,in} (K_\mathrm{in,in} + \lambda I)^{-1}r_\mathrm{in}`.
    """
    n = len(problem)
    if n > ROWS:
        rows = np.sort(random_state.choice(n, ROWS, replace=False))
        problem, trajectories = problem.rows(torch.as_tensor(rows, device=problem.y.device)), trajectories[rows]
    K, r, _ = _linearised(problem, psi, activation, adapter)
    names, codes = np.unique(trajectories, return_inverse=True)
    fold = random_state.permutation(len(names))[codes] % min(FOLDS, len(names))
    # Mean squared error of each run for each strength; the last is that of the source as it is.
    errors = np.zeros((len(STRENGTHS) + 1, len(names)))
    np.add.at(errors[-1], codes, r**2)
    for k in range(fold.max() + 1):
        out = fold == k
        values, vectors = np.linalg.eigh(K[np.ix_(~out, ~out)])
        cross, inner = K[np.ix_(out, ~out)] @ vectors, vectors.T @ r[~out]
        share = float(np.mean(~out))
        for i, strength in enumerate(STRENGTHS):
            left = r[out] - cross @ (inner / (np.maximum(values, 0.0) + strength * share))
            np.add.at(errors[i], codes[out], left**2)
    strength = float(errors.sum(axis=1).min()) / (n * MOVE**2)
    if strength <= 0.0:
        return STRENGTHS[0]
    nearest = int(np.argmin(np.abs(np.log(np.array(STRENGTHS) / strength))))
    excess = errors[nearest] - errors[-1]
    return np.inf if excess.sum() > np.sqrt(len(names)) * excess.std() else strength


def _linearised(
    problem: TrainingProblem, psi: Parameters, activation: str, adapter: Reparametrisation
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the Gram matrix and the residuals at psi, both times the roots of the weights, and these roots."""
    theta = adapter.expand(psi)
    tape = forward(theta, problem.x, problem.direction, problem.a, activation)
    root = (problem.weight / problem.weight.sum()).sqrt()
    adjoint = [pair * root[:, None] for pair in adjoints(theta, tape)]
    K = adapter.gram(psi, adjoint, tape) if psi else 0.0 * root[:, None] * root
    r = root * (tape.y - problem.y)
    return K.double().cpu().numpy(), r.double().cpu().numpy(), root.double().cpu().numpy()


def held_out_residuals(
    problem: TrainingProblem,
    psi: Parameters,
    activation: str,
    adapter: Reparametrisation,
    blocks: np.ndarray,
    weight_decay: float,
) -> np.ndarray:
    """Return the residual that the linearised adaptation to all other blocks leaves of each block."""
    K, r, root = _linearised(problem, psi, activation, adapter)
    if not psi or not np.isfinite(weight_decay):
        return np.asarray(r / root)
    inverse = np.linalg.inv(K + max(weight_decay, STRENGTHS[0]) * np.eye(len(r)))
    return np.asarray(left_of_blocks(inverse, r, blocks) / root)

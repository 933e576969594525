"""Steepest descent with a step that adapts. Copy to ``pamid/training/my_trainer.py`` and change the step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .network import Parameters, adjoints, forward, transposed_product
from .problem import TrainingProblem
from .reparametrisation import IDENTITY, Reparametrisation
from .trainer import Trainer


class MyTrainer(Trainer):
    """Steepest descent: a step that lowers the loss makes the next one longer, one that does not is halved.

    Parameters
    ----------
    max_iter : int, default=200
        Steps.
    learning_rate : float, default=0.1
        First step, in units of the gradient.
    patience : int, default=50
        Steps without a new best on held-out trajectories after which training stops.
    """

    def __init__(self, max_iter: int = 200, *, learning_rate: float = 0.1, patience: int = 50) -> None:
        self.max_iter = max_iter
        self.learning_rate = learning_rate
        self.patience = patience

    def steps(
        self,
        problem: TrainingProblem,
        parameters: Parameters,
        activation: str,
        random_state: np.random.RandomState,
        prior: Parameters | None = None,
        adapter: Reparametrisation = IDENTITY,
        state: dict[str, Any] | None = None,
    ) -> Iterator[tuple[Parameters, float]]:
        """Yield the parameters and the loss after each step."""
        psi, rate = [p.clone() for p in parameters], self.learning_rate
        root = (problem.weight / problem.weight.sum()).sqrt()
        for _ in range(self.max_iter):
            theta = adapter.expand(psi)
            tape = forward(theta, problem.x, problem.direction, problem.a, activation)
            r = root * (tape.y - problem.y)
            back = transposed_product([pair * root[:, None] for pair in adjoints(theta, tape)], tape, 2.0 * r)
            gradient, before = adapter.pullback(psi, back), float(r @ r)
            while rate > 1e-12:
                trial = [p - rate * g for p, g in zip(psi, gradient, strict=True)]
                moved = forward(adapter.expand(trial), problem.x, problem.direction, problem.a, activation)
                after = float(((root * (moved.y - problem.y)) ** 2).sum())
                if after < before:
                    psi, rate = trial, 1.5 * rate
                    break
                rate *= 0.5
            else:
                return
            yield psi, after

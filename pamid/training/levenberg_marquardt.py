r"""Levenberg–Marquardt in the space of the samples, made for laws that read a network linearly.

With fewer samples in a step than parameters in the network, the damped normal equations

.. math:: (J^T J + c I)\,\delta = -J^T r - \lambda(\theta - \theta_0), \qquad c = \mu + \lambda

are solved through the Gram matrix :math:`J J^T`, which a layered network gives as a sum of products of small Gram
matrices: no Jacobian of the whole network is formed, and a step costs a few products of (samples × width) matrices
and one Cholesky factor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch

from ..fitting.marquardt import Damping
from .network import Parameters, Tape, adjoints, forward, jacobian_product, transposed_product
from .problem import TrainingProblem
from .reparametrisation import IDENTITY, Reparametrisation
from .trainer import Trainer

AVERAGE = 0.1
"""Share of a new step in the running mean of the parameters, where steps are taken on draws of samples."""


class LevenbergMarquardt(Trainer):
    """Train by damped Gauss–Newton steps, each on a fresh draw of samples where there are many.

    Parameters
    ----------
    max_iter : int, default=150
        Steps.
    batch_size : int, default=512
        Samples a step; all of them if there are fewer. Memory grows with its square, time with its cube at the end.
    weight_decay : float, default=1e-6
        λ: the strength of the pull toward the start of the parameters' prior (zero from scratch, the source's
        parameters in an adaptation), relative to the mean squared residual in units of the target's variance.
    damping : float, default=1e-3
        First damping μ, relative to the trace of the Gram matrix of the weighted mean.
    tolerance : float, default=1e-9
        Relative fall of the penalised loss below which full-batch training counts as converged.
    patience : int, default=40
        Steps without a new best on held-out trajectories, where there are any, after which training stops.
    checkpoint : path-like, optional
        Folder in which a training keeps its state, so that one that is killed goes on to the same result.

    References
    ----------
    D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", SIAM Journal on Applied
    Mathematics 11(2), 1963. https://doi.org/10.1137/0111030

    Examples
    --------
    >>> from pamid.estimators import StaticPIHM
    >>> from pamid.training import LevenbergMarquardt
    >>> model = StaticPIHM(trainer=LevenbergMarquardt(max_iter=10))
    """

    second_order: ClassVar[bool] = True

    def __init__(
        self,
        max_iter: int = 150,
        *,
        batch_size: int = 512,
        weight_decay: float = 1e-6,
        damping: float = 1e-3,
        tolerance: float = 1e-9,
        patience: int = 40,
        checkpoint: str | None = None,
    ) -> None:
        self.max_iter = max_iter
        self.batch_size = batch_size
        self.weight_decay = weight_decay
        self.damping = damping
        self.tolerance = tolerance
        self.patience = patience
        self.checkpoint = checkpoint

    def loss_covers(self, n_samples: int) -> bool:
        """Say whether a step takes all samples."""
        return n_samples <= self.batch_size

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
        """Yield the parameters and the loss of the step's samples after each step."""
        state = {} if state is None else state
        psi = state.get("psi") or [p.clone() for p in parameters]
        origin = [torch.zeros_like(p) for p in parameters] if prior is None else prior
        mean = state.get("mean") or psi
        n = len(problem)
        damping = Damping(float(state.get("mu", self.damping)), shrink=0.5, grow=4.0, least=1e-13, most=1e8)
        full = n <= self.batch_size
        if state.get("converged"):
            return
        for k in range(int(state.get("steps", 0)), self.max_iter):
            batch = problem
            if not full:
                rows = random_state.choice(n, self.batch_size, replace=False)
                batch = problem.rows(torch.as_tensor(rows, device=problem.y.device))
            root = (batch.weight / batch.weight.sum()).sqrt()
            theta = adapter.expand(psi)
            tape = forward(theta, batch.x, batch.direction, batch.a, activation)
            r = root * (tape.y - batch.y)
            before = float(r @ r) + self._penalty(psi, origin)
            if not np.isfinite(before):
                yield psi, before
                return
            equations = self._equations(psi, origin, tape, r, root, theta, adapter)

            def loss(trial: Parameters, batch: TrainingProblem = batch, root: torch.Tensor = root) -> float:
                moved = forward(adapter.expand(trial), batch.x, batch.direction, batch.a, activation)
                r = root * (moved.y - batch.y)
                return float(r @ r) + self._penalty(trial, origin)

            found = damping.descend(before, equations.trial, loss)
            if found is None:
                if full:
                    return
                damping.value = self.damping
                continue
            psi, after = found
            # Steps on fresh draws scatter about the minimum; their running mean lies closer to it.
            mean = psi if full else [p.lerp(q, AVERAGE) for p, q in zip(mean, psi, strict=True)]
            converged = full and before - after < self.tolerance * before
            state |= {"steps": k + 1, "psi": psi, "mean": mean, "mu": damping.value, "converged": converged}
            yield mean, after - self._penalty(psi, origin)
            if converged:
                return

    def _penalty(self, psi: Parameters, origin: Parameters) -> float:
        return self.weight_decay * sum(float(((p - q) ** 2).sum()) for p, q in zip(psi, origin, strict=True))

    def _equations(
        self,
        psi: Parameters,
        origin: Parameters,
        tape: Tape,
        r: torch.Tensor,
        root: torch.Tensor,
        theta: Parameters,
        adapter: Reparametrisation,
    ) -> _DampedEquations:
        adjoint = [pair * root[:, None] for pair in adjoints(theta, tape)]
        pull = [self.weight_decay * (p - q) for p, q in zip(psi, origin, strict=True)]
        return _DampedEquations(
            psi, pull, tape, adjoint, adapter.gram(psi, adjoint, tape), r, adapter, self.weight_decay
        )


@dataclass(frozen=True)
class _DampedEquations:
    """The normal equations around one point, to be solved for any damping in the space of the samples."""

    psi: Parameters
    pull: Parameters
    tape: Tape
    adjoint: list[torch.Tensor]
    gram: torch.Tensor
    residual: torch.Tensor
    adapter: Reparametrisation
    weight_decay: float

    def trial(self, damping: float) -> Parameters | None:
        """Return the parameters after a step; None if the floating type is too coarse for this damping."""
        c = damping * float(self.gram.trace()) + self.weight_decay
        along = jacobian_product(self.adjoint, self.tape, self.adapter.pushforward(self.psi, self.pull))
        A = self.gram / c
        A.diagonal().add_(1.0)
        factor, failed = torch.linalg.cholesky_ex(A)
        if int(failed):
            return None
        u = torch.cholesky_solve((self.residual - along / c)[:, None], factor)[:, 0]
        back = self.adapter.pullback(self.psi, transposed_product(self.adjoint, self.tape, u))
        return [p - (q + s) / c for p, q, s in zip(self.psi, self.pull, back, strict=True)]

r"""Levenberg–Marquardt in the space of the samples, made for laws that read a network linearly.

With fewer samples in a step than parameters in the network, the damped normal equations

.. math:: (J^T J + c I)\,\delta = -J^T r - \lambda(\theta - \theta_0), \qquad c = \mu + \lambda

are solved through the Gram matrix :math:`J J^T`, which a layered network gives as a sum of products of small Gram
matrices: no Jacobian of the whole network is formed, and a step costs a few products of (samples × width) matrices
and one Cholesky factor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch

from ..explained import parameters
from ..fitting.marquardt import Damping
from .network import Parameters, Tape, adjoints, forward, jacobian_product, transposed_product
from .problem import TrainingProblem
from .reparametrisation import IDENTITY, Reparametrisation
from .trainer import Trainer

AVERAGE = 0.1
"""Share of a new step in the running mean of the parameters, where steps are taken on draws of samples."""


@parameters
class LevenbergMarquardt(Trainer):
    """Train by damped Gauss–Newton steps, each on a fresh draw of samples where there are many.

    Parameters
    ----------
    max_iter : int, default=150
        Steps.
    batch_size : int, default=512
        Samples per step; all of them if there are fewer. Memory grows with its square, time with its cube at the end.
    weight_decay : float, default=1e-6
        λ: the strength of the pull toward the start of the parameters' prior (zero from scratch, the source's
        parameters in an adaptation), relative to the mean squared residual in units of the target's variance.
    damping : float, default=1e-3
        First damping μ, relative to the trace of the Gram matrix of the weighted mean.
    tolerance : float, default=1e-9
        Relative fall of the penalised loss below which full-batch training counts as converged.
    patience : int, default=40
        Steps without a new best on held-out runs, where there are any, after which training stops.
    checkpoint : path-like, optional
        Folder in which a training keeps its state, so that a killed training resumes to the same result.

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

    max_iter: int = 150
    _: KW_ONLY
    batch_size: int = 512
    weight_decay: float = 1e-6
    damping: float = 1e-3
    tolerance: float = 1e-9
    patience: int = 40
    checkpoint: str | None = None

    def loss_covers(self, n_samples: int) -> bool:
        """Return whether a step takes all samples."""
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
        last: _Pass | None = None
        if state.get("converged"):
            return
        for k in range(int(state.get("steps", 0)), self.max_iter):
            batch = problem
            if not full:
                rows = random_state.choice(n, self.batch_size, replace=False)
                batch = problem.rows(torch.as_tensor(rows, device=problem.y.device))
            root = (batch.weight / batch.weight.sum()).sqrt()
            passed = partial(self._pass, origin, batch, root, activation, adapter)
            # With all samples in each step, what the last one ended with is what this one begins with.
            here = last if full and last is not None else passed(psi)
            if not np.isfinite(here.loss):
                yield psi, here.loss
                return
            found = damping.descend(here.loss, partial(_tried, self._equations(here, root, adapter), passed), _loss)
            if found is None:
                if full:
                    return
                damping.value = self.damping
                continue
            last, after = found
            psi = last.psi
            # Steps on fresh draws scatter about the minimum; their running mean lies closer to it.
            mean = psi if full else [p.lerp(q, AVERAGE) for p, q in zip(mean, psi, strict=True)]
            converged = full and here.loss - after < self.tolerance * here.loss
            state |= {"steps": k + 1, "psi": psi, "mean": mean, "mu": damping.value, "converged": converged}
            yield mean, after - last.penalty
            if converged:
                return

    def _pass(
        self,
        origin: Parameters,
        batch: TrainingProblem,
        root: torch.Tensor,
        activation: str,
        adapter: Reparametrisation,
        psi: Parameters,
    ) -> _Pass:
        theta = adapter.expand(psi)
        tape = forward(theta, batch.x, batch.direction, batch.a, activation)
        r = tape.y.sub(batch.y).mul_(root)
        pull = [p - q for p, q in zip(psi, origin, strict=True)]
        squares = float(sum(torch.dot(p.view(-1), p.view(-1)) for p in pull))
        return _Pass(psi, theta, tape, r, pull, float(r @ r), self.weight_decay * squares)

    def _equations(self, here: _Pass, root: torch.Tensor, adapter: Reparametrisation) -> _DampedEquations:
        adjoint = adjoints(here.theta, here.tape, root)
        pull = [self.weight_decay * p for p in here.pull]
        gram = adapter.gram(here.psi, adjoint, here.tape)
        return _DampedEquations(here.psi, pull, here.tape, adjoint, gram, here.residual, adapter, self.weight_decay)


class _Pass(NamedTuple):
    """A pass through the network: parameters, intermediate values, residuals and parts of the loss."""

    psi: Parameters
    theta: Parameters
    tape: Tape
    residual: torch.Tensor
    pull: Parameters
    square: float
    penalty: float

    @property
    def loss(self) -> float:
        """Squared residuals and penalty."""
        return self.square + self.penalty


def _loss(trial: _Pass) -> float:
    return trial.loss


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
        return [p.sub(q + s, alpha=1.0 / c) for p, q, s in zip(self.psi, self.pull, back, strict=True)]


def _tried(equations: _DampedEquations, passed: Callable[[Parameters], _Pass], damping: float) -> _Pass | None:
    """Return the pass at the end of a damped step; None if there is none."""
    psi = equations.trial(damping)
    return None if psi is None else passed(psi)

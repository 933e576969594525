"""Algorithms 1 and 2 of the study as printed: Adam with the decay in loss and gradient, and ε inside the root."""

import math
from collections.abc import Iterator
from contextlib import ExitStack, nullcontext
from dataclasses import KW_ONLY
from typing import Any

import numpy as np
import torch

from ..errors import UnknownOptionError
from ..explained import parameters
from .host import BLOCK, HostGradient
from .network import Parameters, forward, gradient
from .problem import TrainingProblem
from .reparametrisation import IDENTITY, Reparametrisation
from .trainer import Trainer


@parameters
class Adam(Trainer):
    r"""Train by Algorithm 1 as printed; with an adapter whose rates differ, by Algorithm 2.

    Every epoch visits the samples once, in new random batches. A batch gives

    .. math:: \mathcal{L} = \mathrm{MSE} + \frac{\lambda}{2}\lVert\theta\rVert^2, \quad
        g = \nabla\mathcal{L} + \lambda\theta, \quad
        \theta \leftarrow \theta - \eta\,\frac{\hat M}{\sqrt{\hat V + \epsilon}}

    so that the decay, 2λθ in total, passes through Adam's moments (it is not decoupled), and the parameters of the last
    epoch are kept. Three options select the more common form of Adam.

    Parameters
    ----------
    max_iter : int, default=10000
        Epochs.
    learning_rate : float, default=1e-4
        Step size η.
    weight_decay : float, default=1e-5
        λ.
    batch_size : int, default=2048
        Samples per batch (2048 from scratch, 128 in adaptation, in the study).
    beta1 : float, default=0.9
        Decay of the first moment.
    beta2 : float, default=0.999
        Decay of the second moment.
    epsilon : float, default=1e-8
        ε, whose value the study does not print.
    decay : {"twice", "once"}, default="twice"
        Whether λθ is added to the gradient of a loss that holds λ/2 ‖θ‖² already, as printed, or counts once.
    epsilon_inside : bool, default=True
        Whether ε is under the root, as printed, so that gradients below √ε take small steps; or outside it, as in
        Kingma and Ba.
    keep : {"last", "best"}, default="last"
        Which parameters are kept: those of the last epoch, as printed, or those that are best on held-out runs, or on
        the training samples if none are held out; with ``"best"`` training ends after `patience`.
    patience : int, default=500
        With ``keep="best"``: epochs without a new best on held-out runs after which training stops.
    checkpoint : path-like, optional
        Folder in which a training keeps its state, so that a killed training resumes to the same result.

    References
    ----------
    D. P. Kingma, J. Ba, "Adam: a method for stochastic optimization", 2014. https://doi.org/10.48550/arXiv.1412.6980

    Examples
    --------
    >>> from pamid.training import Adam
    >>> trainer = Adam()
    >>> trainer.learning_rate, trainer.weight_decay, trainer.batch_size
    (0.0001, 1e-05, 2048)
    """

    max_iter: int = 10_000
    _: KW_ONLY
    learning_rate: float = 1e-4
    weight_decay: float = 1e-5
    batch_size: int = 2048
    beta1: float = 0.9
    beta2: float = 0.999
    epsilon: float = 1e-8
    decay: str = "twice"
    epsilon_inside: bool = True
    keep: str = "last"
    patience: int = 500
    checkpoint: str | None = None

    def check(self) -> None:
        """Raise `ParameterError` for a number out of its domain, `UnknownOptionError` for an option that is not one."""
        super().check()
        for name, known in (("decay", ("twice", "once")), ("keep", ("last", "best"))):
            if getattr(self, name) not in known:
                raise UnknownOptionError(
                    f"Adam({name}={getattr(self, name)!r}).",
                    f"{known[0]!r} (as printed) or {known[1]!r}",
                    "Correct it.",
                )

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
        """Yield the parameters and the mean loss of the epoch; the published decay knows no prior but zero."""
        state = {} if state is None else state
        # One flat vector holds all parameters: the optimiser is then a few operations, however many layers there are.
        flat = torch.cat([p.reshape(-1) for p in parameters])
        g, first, second = torch.empty_like(flat), torch.zeros_like(flat), torch.zeros_like(flat)
        shapes = [p.shape for p in parameters]
        pull = self.weight_decay * (2.0 if self.decay == "twice" else 1.0)
        net = _Network(flat, g, shapes, adapter)
        n, step, begun = len(problem), int(state.get("step", 0)), int(state.get("epochs", 0))
        if begun:
            for own, kept in ((flat, state["flat"]), (first, state["first"]), (second, state["second"])):
                own.copy_(kept)
        with ExitStack() as stack:
            host = None
            if flat.device.type == "cpu":
                threads = min(torch.get_num_threads(), self.batch_size // BLOCK)
                host = HostGradient(net.flat.numpy(), net.gradient.numpy(), net.shapes, activation, threads)
                stack.callback(host.close)
            for epoch in range(begun, self.max_iter):
                total = torch.zeros_like(flat[0])
                with host.alone() if host else nullcontext():
                    drawn = problem
                    if n > self.batch_size:
                        drawn = problem.rows(torch.as_tensor(random_state.permutation(n), device=flat.device))
                    for start in range(0, n, self.batch_size):
                        batch = drawn.rows(slice(start, start + self.batch_size))
                        net.expand()
                        total += host(batch) if host else device_gradient(net.theta, batch, activation, net.slots)
                        net.pull_back()
                        g.add_(flat, alpha=pull)
                        step += 1
                        first.lerp_(g, 1.0 - self.beta1)
                        second.mul_(self.beta2).addcmul_(g, g, value=1.0 - self.beta2)
                        # Both bias corrections are numbers, so they go into the step size and the division's guard.
                        unbiased = 1.0 - self.beta2**step
                        rate = self.learning_rate * math.sqrt(unbiased) / (1.0 - self.beta1**step)
                        if self.epsilon_inside:
                            torch.add(second, self.epsilon * unbiased, out=g).sqrt_()
                        else:
                            torch.sqrt(second, out=g).add_(self.epsilon * math.sqrt(unbiased))
                        flat.addcdiv_(first, g if net.shares is None else g.div_(net.shares), value=-rate)
                state |= {"epochs": epoch + 1, "step": step, "flat": flat, "first": first, "second": second}
                yield views(flat.clone(), shapes), float(total) / float(problem.weight.sum())


class _Network:
    """The network behind a flat vector of trained parameters, with its gradient."""

    def __init__(
        self, psi: torch.Tensor, gradient: torch.Tensor, shapes: list[torch.Size], adapter: Reparametrisation
    ) -> None:
        self._adapter = None if adapter is IDENTITY else adapter
        self._psi, self._by_psi = views(psi, shapes), views(gradient, shapes)
        self.flat, self.gradient, self.shapes, self.shares = psi, gradient, shapes, None
        if self._adapter is not None:
            theta = self._adapter.expand(self._psi)
            self.flat, self.shapes = torch.cat([t.reshape(-1) for t in theta]), [t.shape for t in theta]
            self.gradient = torch.empty_like(self.flat)
            rates = self._adapter.rates(self._psi)
            if any(r != 1.0 for r in rates):
                self.shares = torch.cat(
                    [torch.full_like(p.reshape(-1), r) for p, r in zip(self._psi, rates, strict=True)]
                )
        self.theta, self.slots = views(self.flat, self.shapes), views(self.gradient, self.shapes)

    def expand(self) -> None:
        """Bring the network up to the trained parameters."""
        if self._adapter is not None:
            for t, value in zip(self.theta, self._adapter.expand(self._psi), strict=True):
                t.copy_(value)

    def pull_back(self) -> None:
        """Bring the network's gradient to the trained parameters."""
        if self._adapter is not None:
            for slot, value in zip(self._by_psi, self._adapter.pullback(self._psi, self.slots), strict=True):
                slot.copy_(value)


def device_gradient(theta: Parameters, batch: TrainingProblem, activation: str, out: Parameters) -> torch.Tensor:
    """Return the summed loss of a batch, without waiting for it; put the gradient of its mean loss into `out`."""
    tape = forward(theta, batch.x, batch.direction, batch.a, activation)
    residual = tape.y - batch.y
    scaled = batch.weight * residual
    total = scaled @ residual
    for slot in out:
        slot.zero_()
    gradient(theta, tape, scaled.mul_(2.0 / batch.weight.sum()), out)
    return total


def views(flat: torch.Tensor, shapes: list[torch.Size]) -> Parameters:
    """Cut a flat vector into tensors of the given shapes."""
    pieces = torch.split(flat, [shape.numel() for shape in shapes])
    return [piece.view(shape) for piece, shape in zip(pieces, shapes, strict=True)]

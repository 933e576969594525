"""What the plain network baselines share: scaling, whole runs held out, and the loop over epochs.

torch is imported inside the functions that need it. Parameters travel as dicts of numpy arrays.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np

from ..errors import DivergedError, MissingTrajectoryError, ParameterError, TooFewTrajectoriesError

Weights = dict[str, np.ndarray]


def local_generator(random_state: Any) -> np.random.Generator:
    """Return a generator of its own: no global generator is read or moved, whatever `random_state` is."""
    if isinstance(random_state, np.random.RandomState):
        return np.random.default_rng(random_state.randint(2**31 - 1))
    return np.random.default_rng(random_state)


def standardisation(columns: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean and standard deviation of each column; 1 for the deviation of a constant one."""
    share = weights / weights.sum()
    mean = share @ columns
    deviation = np.sqrt(share @ (columns - mean) ** 2)
    return mean, np.where(deviation > 1e-12 * np.maximum(1.0, np.abs(mean)), deviation, 1.0)


def held_out_rows(codes: np.ndarray | None, fraction: float, rng: np.random.Generator, needed_by: str) -> np.ndarray:
    """Choose whole runs, about `fraction` of them and at least one; mark their rows."""
    if codes is None:
        raise MissingTrajectoryError(
            f"{needed_by} stops early on held-out trajectories, and got neither groups nor a column 'trajectory'.",
            "one of the two",
            "Pass groups=, keep a 'trajectory' column in a DataFrame, or set early_stopping=False.",
        )
    names = np.unique(codes)
    if len(names) < 2:
        raise TooFewTrajectoriesError(
            f"{needed_by} stops early on held-out runs, but got only one run.",
            "at least two runs",
            "Give more runs, or set early_stopping=False.",
        )
    if not 0 < fraction < 1:
        raise ParameterError(
            f"validation_fraction is {fraction!r}.", "a number between 0 and 1", "Correct validation_fraction."
        )
    return drawn_rows(codes, fraction, rng)


def drawn_rows(
    codes: np.ndarray, fraction: float, rng: np.random.Generator | np.random.RandomState, left: int = 1
) -> np.ndarray:
    """Draw about a fraction of the runs, at least one, and leave at least so many; mark their rows."""
    names = np.unique(codes)
    count = min(max(1, round(fraction * len(names))), len(names) - left)
    return np.isin(codes, rng.choice(names, size=count, replace=False))


@dataclass
class Best:
    """The best weights of a fit so far, and when to give up waiting for better ones."""

    patience: int
    tol: float
    weights: Weights | None = None
    score: float = math.inf
    curve: list[float] = field(default_factory=list)
    _reference: float = math.inf
    _waited: int = 0

    def offer(self, score: float, weights: Callable[[], Weights]) -> bool:
        """Take the weights if they are the best; return whether `patience` epochs brought less than `tol`."""
        self.curve.append(float(score))
        if not math.isfinite(score):
            if self.weights is None:
                raise DivergedError(
                    f"The loss is {score} after {len(self.curve)} epochs.",
                    "a finite loss",
                    "Lower learning_rate, and check the scale of the signals.",
                )
            return True
        if score < self.score:
            self.score, self.weights = float(score), weights()
        self._waited = 0 if score < self._reference * (1 - self.tol) else self._waited + 1
        self._reference = min(self._reference, score)
        return self._waited >= self.patience


class AdamSteps:
    """Adam on tensors with a decaying rate (D. P. Kingma, J. Ba, 2015, https://doi.org/10.48550/arXiv.1412.6980)."""

    def __init__(self, parameters: dict[str, Any], learning_rate: float) -> None:
        import torch

        self.learning_rate = learning_rate
        self._adam = torch.optim.Adam(list(parameters.values()), lr=learning_rate)

    def anneal(self, progress: float) -> None:
        """Lower the rate along a half cosine to 1 % of it; `progress` runs from 0 to 1."""
        rate = self.learning_rate * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(progress, 1.0))))
        for group in self._adam.param_groups:
            group["lr"] = rate

    def step(self, loss: Any) -> None:
        """Descend one step on a loss."""
        self._adam.zero_grad(set_to_none=True)
        loss.backward()
        self._adam.step()


def to_tensors(weights: Weights, device: str) -> dict[str, Any]:
    """Copy weights into tensors that are trained."""
    import torch

    return {name: torch.tensor(w, dtype=torch.float64, device=device).requires_grad_() for name, w in weights.items()}


def to_arrays(tensors: dict[str, Any]) -> Weights:
    """Copy tensors into numpy arrays."""
    return {name: tensor.detach().cpu().numpy().copy() for name, tensor in tensors.items()}


def penalty(tensors: Sequence[Any], alpha: float) -> Any:
    """Weight decay of the matrices, to be added to a loss; biases are free."""
    return alpha * sum((w**2).sum() for w in tensors if w.ndim > 1) if alpha else 0.0


class Progress(Protocol):
    """The epochs of a fit as its owner counts them, who hears of each and may end them."""

    def __iter__(self) -> Iterator[int]:
        """Count the epochs."""
        ...

    def report(
        self,
        loss: float,
        *,
        validation_loss: float | None = None,
        attributes: Callable[[], dict[str, Any]] | None = None,
    ) -> bool:
        """Hear of an epoch that has ended; say whether to stop."""
        ...


def run_epochs(
    progress: Progress,
    best: Best,
    tensors: dict[str, Any],
    one_epoch: Callable[[int], float],
    validate: Callable[[], float] | None,
    *,
    one_step: bool,
    attributes: Callable[[Weights], dict[str, Any]],
) -> None:
    """Run epochs to the last, to no improvement, or to a stop; without held-out rows the training loss decides."""
    for epoch in progress:
        before = to_arrays(tensors) if one_step and validate is None else None
        loss = one_epoch(epoch)
        score = loss if validate is None else validate()
        enough = best.offer(score, partial(_first_of, before, tensors))
        shown = None if validate is None else score
        progress.report(loss, validation_loss=shown, attributes=partial(attributes, best.weights or {}))
        if enough:
            break


def _first_of(kept: Weights | None, tensors: dict[str, Any]) -> Weights:
    return to_arrays(tensors) if kept is None else kept

"""What a trainer returns, and why it stopped."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Any

from ..explained import explained_fields
from .network import Parameters

Callback = Callable[[float, Parameters], bool]
"""Called with the loss and the parameters after every iteration; returns whether to stop."""


class Status(Enum):
    """Why a training ended. The value says what happened, why, and what can be changed.

    Examples
    --------
    >>> from pamid.training import Status
    >>> [s.name for s in Status][:2]
    ['FINISHED', 'CONVERGED']
    """

    FINISHED = "All iterations were carried out."
    CONVERGED = "No step lowers the loss by more than the tolerance any more."
    STOPPED_EARLY = "The error on the held-out runs has not fallen for `patience` iterations; the best is kept."
    STOPPED_BY_CALLBACK = "A callback asked to stop; the parameters so far are kept."
    INTERRUPTED = "The training was interrupted; the parameters so far are kept. Fit again to go on."
    DIVERGED = (
        "The loss became infinite or NaN; the parameters before that are kept. The usual causes are signals in wrong "
        "units, outliers, or a learning rate that is too high."
    )


@explained_fields
@dataclass
class TrainingResult:
    """Outcome of a training.

    Examples
    --------
    >>> from pamid.training import Status, TrainingResult
    >>> done = TrainingResult([], Status.CONVERGED, 12, [0.5, 0.01], [])
    >>> done.loss_curve[-1]
    0.01
    """

    parameters: Annotated[
        Parameters,
        "The weights and biases that are kept: the best ones, or those of the last iteration (`Trainer.keeps_last`).",
    ]
    status: Annotated[Status, "Why the training ended."]
    n_iter: Annotated[int, "Iterations carried out."]
    loss_curve: Annotated[
        list[float], "Mean squared residual after each iteration, in units of the target's variance."
    ] = field(default_factory=list)
    validation_curve: Annotated[list[float], "The same on held-out runs; empty without any."] = field(
        default_factory=list
    )


class BestSoFar:
    """Remember the parameters of a training that are to be kept, and decide when patience ends."""

    def __init__(self, patience: int, *, last: bool = False) -> None:
        self.patience = patience
        self.last = last
        self.score = float("inf")
        self.parameters: Parameters = []
        self.since = 0

    def offer(self, score: float, parameters: Parameters) -> None:
        """Keep the parameters if their score is the best so far, or in any case if asked to."""
        if self.last or score < self.score or not self.parameters:
            self.score, self.since = score, 0
            self.parameters = [p.clone() for p in parameters]
        else:
            self.since += 1

    @property
    def state(self) -> dict[str, Any]:
        """All of it, for another one to go on from."""
        return {"score": self.score, "since": self.since, "parameters": self.parameters}

    @state.setter
    def state(self, state: dict[str, Any]) -> None:
        self.score, self.since, self.parameters = float(state["score"]), int(state["since"]), state["parameters"]

    @property
    def stale(self) -> bool:
        """Whether there was no new best for `patience` iterations."""
        return self.since >= self.patience

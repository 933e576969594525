"""What a trainer is, and the loop that all trainers share: best so far, early stopping, callbacks, interruption."""

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import torch
from sklearn.base import BaseEstimator

from ..errors import ParameterError
from .network import Parameters, forward
from .problem import TrainingProblem
from .reparametrisation import IDENTITY, Reparametrisation
from .result import BestSoFar, Callback, Status, TrainingResult
from .resume import Resumption, fingerprint
from .units import TrainingUnits

EVALUATION_ROWS = 8192
"""Rows on which the loss of the current parameters is judged; more would cost without telling more."""

DRAW_EVALUATION_ROWS = 2048
"""The same for a trainer whose own losses are those of small draws, and whose steps are cheap."""


def mean_squared_residual(parameters: Parameters, problem: TrainingProblem, activation: str) -> float:
    """Return the weighted mean squared residual of a law on a problem."""
    y = forward(parameters, problem.x, problem.direction, problem.a, activation).y
    return float((problem.weight * (y - problem.y) ** 2).sum() / problem.weight.sum())


class Trainer(BaseEstimator):
    """Base of the trainers. A trainer is a generator of parameters: `steps` yields after every iteration.

    It derives from scikit-learn's `BaseEstimator` for its parameters alone, so that ``trainer__max_iter`` and the
    like can be searched over.

    Examples
    --------
    >>> from pamid.training import Adam, LevenbergMarquardt, Trainer
    >>> issubclass(Adam, Trainer), issubclass(LevenbergMarquardt, Trainer)
    (True, True)
    """

    max_iter: int
    patience: int
    keep: str = "best"
    checkpoint: Any = None
    units: ClassVar[TrainingUnits | None] = None
    """Units that the network is trained in; by default the spread of its data."""
    adapting: ClassVar[dict[str, int]] = {}
    """Parameters that differ where a model is adapted."""
    second_order: ClassVar[bool] = False
    """Whether it solves for its steps, so that the strength of a prior means the same for every network."""

    @abstractmethod
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
        """Yield the parameters and the mean squared residual after each iteration.

        A trainer with a parameter ``checkpoint`` takes `state`: it goes on from one that is not empty, and has put all
        that the next iteration needs into it, tensors, numbers, lists and texts, whenever it yields.
        """

    def _kept(
        self,
        problem: TrainingProblem,
        parameters: Parameters,
        activation: str,
        random_state: np.random.RandomState,
        *others: Any,
    ) -> tuple[Resumption | None, dict[str, Any]]:
        """Return where the state of this training is kept, if it is, and a place for it."""
        folder = self.checkpoint
        if folder is None:
            return None, {}
        settings = {k: v for k, v in self.get_params(deep=False).items() if k != "checkpoint"}
        numbers = random_state.get_state(legacy=True)
        what = (type(self).__name__, settings, problem, parameters, activation, numbers, others)
        return Resumption(folder, fingerprint(*what)), {}

    @property
    def keeps_last(self) -> bool:
        """Whether the parameters of the last iteration are kept, and none are held out to judge them."""
        return self.keep == "last"

    def loss_covers(self, n_samples: int) -> bool:
        """Return whether the losses that `steps` yields are means over all samples, not over a draw of them."""
        return True

    def check(self) -> None:
        """Raise `ParameterError` for a parameter that is out of its domain."""
        for name, value in self.get_params(deep=False).items():
            whole = name in ("max_iter", "batch_size", "patience")
            if whole and not (isinstance(value, int | np.integer) and value >= 1):
                raise ParameterError(
                    f"{type(self).__name__}({name}={value!r}).", "a whole number of at least 1", "Correct it."
                )
            if not whole and isinstance(value, int | float) and not (np.isfinite(value) and value >= 0):
                raise ParameterError(
                    f"{type(self).__name__}({name}={value!r}).", "a finite number that is not negative", "Correct it."
                )

    def _judged(self, problem: TrainingProblem, random_state: np.random.RandomState) -> TrainingProblem:
        """Return the rows by whose loss parameters are compared where none are held out."""
        # The loss of a draw says which draw was lucky, not which parameters are good.
        most = EVALUATION_ROWS if self.loss_covers(len(problem)) else DRAW_EVALUATION_ROWS
        if len(problem) <= most or self.keeps_last:
            return problem
        rows = random_state.choice(len(problem), most, replace=False)
        return problem.rows(torch.as_tensor(np.sort(rows), device=problem.y.device))

    def run(
        self,
        problem: TrainingProblem,
        parameters: Parameters,
        activation: str,
        random_state: np.random.RandomState,
        *,
        prior: Parameters | None = None,
        validation: TrainingProblem | None = None,
        callback: Callback | None = None,
        adapter: Reparametrisation = IDENTITY,
    ) -> TrainingResult:
        """Train a network.

        Parameters
        ----------
        problem : TrainingProblem
            What to minimise.
        parameters : list of Tensor
            Where to start; left untouched.
        activation : str
            Name of the activation.
        random_state : numpy.random.RandomState
            The only source of randomness.
        prior : list of Tensor, optional
            Parameters toward which a trainer that has a pull draws; zero by default.
        validation : TrainingProblem, optional
            Held-out runs: the parameters that are best on them are returned, and training stops early; a
            trainer that keeps the last ones is only watched on them.
        callback : callable, optional
            Called with the loss and the parameters after every iteration; returns whether to stop.
        adapter : Reparametrisation, optional
            What the parameters stand for; the network's own weights and biases by default. With one, `parameters`,
            `prior`, and the parameters that are returned and given to the callback are its psi.

        Returns
        -------
        TrainingResult
            The best or the last parameters, and why the training ended.
        """
        self.check()
        kept, state = self._kept(problem, parameters, activation, random_state, prior, validation, adapter)
        judged = self._judged(problem, random_state) if validation is None else validation
        best = BestSoFar(self.patience, last=self.keeps_last)
        best.offer(mean_squared_residual(adapter.expand(parameters), judged, activation), parameters)
        losses: list[float] = []
        held_out: list[float] = []
        status = Status.FINISHED
        through: dict[str, Any] = {} if adapter is IDENTITY else {"adapter": adapter}
        if kept is not None:
            through["state"] = state
            if (saved := kept.load()) is not None:
                state |= saved["trainer"]
                best.state, losses, held_out = saved["best"], saved["losses"], saved["held_out"]
                random_state.set_state(tuple(saved["random"]))
                if saved["status"]:
                    return TrainingResult(best.parameters, Status[saved["status"]], len(losses), losses, held_out)

        def keep(done: str = "") -> None:
            if kept is not None:
                numbers = list(random_state.get_state(legacy=True))
                whole = {"trainer": state, "best": best.state, "losses": losses, "held_out": held_out}
                kept.save(whole | {"random": numbers, "status": done}, at_once=bool(done))

        try:
            for current, loss in self.steps(problem, parameters, activation, random_state, prior, **through):
                own = judged is problem and (self.keeps_last or self.loss_covers(len(problem)))
                score = loss if own else mean_squared_residual(adapter.expand(current), judged, activation)
                losses.append(loss)
                if validation is not None:
                    held_out.append(score)
                if not np.isfinite(loss):
                    status = Status.DIVERGED
                    break
                best.offer(score, current)
                stale = validation is not None and best.stale
                if not stale:  # a training that goes on from here would not know that it had ended
                    keep()
                if callback is not None and callback(loss, current):
                    status = Status.STOPPED_BY_CALLBACK
                    break
                if stale:
                    status = Status.STOPPED_EARLY
                    break
            else:
                status = Status.FINISHED if len(losses) >= self.max_iter else Status.CONVERGED
        except KeyboardInterrupt as stop:
            if type(stop) is not KeyboardInterrupt:  # the system ends the process: nobody waits for a result
                raise
            status = Status.INTERRUPTED
        if status in (Status.FINISHED, Status.CONVERGED, Status.STOPPED_EARLY):
            keep(status.name)
        return TrainingResult(best.parameters, status, len(losses), losses, held_out)

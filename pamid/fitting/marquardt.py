"""Levenberg–Marquardt: damped Gauss–Newton steps on any sum of squares.

D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", SIAM Journal on Applied
Mathematics 11(2), 1963. https://doi.org/10.1137/0111030
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..errors import DivergedError

Point = TypeVar("Point")


@dataclass
class Damping:
    """Marquardt's damping: grown until a step lowers the loss, shrunk after one that does."""

    value: float
    """Damping of the next trial."""
    shrink: float
    grow: float
    """Factors after a step that lowers the loss and after one that does not."""
    least: float
    most: float
    """Bounds: it never falls below the first, and no step is tried above the second."""

    def descend(
        self, before: float, propose: Callable[[float], Point | None], loss: Callable[[Point], float],
        tries: int | None = None,
    ) -> tuple[Point, float] | None:  # fmt: skip
        """Take the first step that lowers the loss; None if there is none in so many, or up to the greatest damping."""
        for _ in range(tries) if tries else count():
            if self.value >= self.most:
                break
            trial = propose(self.value)
            if trial is not None:
                after = loss(trial)
                if after < before:  # never true of one that is not a number
                    self.value = max(self.shrink * self.value, self.least)
                    return trial, after
            self.value *= self.grow
        return None


class Normal(NamedTuple):
    """A sum of squares around a point: its value, half its gradient and its Gauss–Newton matrix."""

    loss: float
    gradient: np.ndarray
    matrix: np.ndarray


class Marquardt:
    """Levenberg–Marquardt `step` by step on a sum of squares plus `alpha` times the squared distance from `centre`."""

    def __init__(
        self,
        start: np.ndarray,
        around: Callable[[np.ndarray], Normal],
        value: Callable[[np.ndarray], float],
        alpha: float = 0.0,
        centre: np.ndarray | None = None,
    ) -> None:
        self.x = start
        self._around, self._value, self._alpha = around, value, alpha
        self._centre = np.zeros_like(start) if centre is None else centre
        self._damping = Damping(1e-2, shrink=0.2, grow=5.0, least=1e-12, most=1e10)
        self.loss = self._penalised(start)
        if not np.isfinite(self.loss):
            raise DivergedError(
                f"The loss is {self.loss} before the first step.", "a finite loss", "Check the scale of the signals."
            )

    def step(self) -> bool:
        """Take one step that lowers the loss; return whether there was one."""
        with np.errstate(over="ignore", invalid="ignore"):
            here = self._around(self.x)
        if not (np.isfinite(here.gradient).all() and np.isfinite(here.matrix).all()):
            return False  # slopes beyond the numbers show no way
        gradient = here.gradient + self._alpha * (self.x - self._centre)
        matrix = here.matrix + self._alpha * np.eye(len(self.x))
        scale = np.maximum(np.diag(matrix), 1e-9 * max(float(np.trace(matrix)) / len(matrix), 1e-300))

        def propose(damping: float) -> np.ndarray | None:
            try:
                delta: Any = cho_solve(cho_factor(matrix + np.diag(damping * scale)), gradient)
            except np.linalg.LinAlgError:
                return None
            return np.asarray(self.x - delta)

        found = self._damping.descend(self.loss, propose, self._penalised)
        if found is None:
            return False
        self.x, self.loss = found
        return True

    def _penalised(self, x: np.ndarray) -> float:
        return self._value(x) + self._alpha * float(np.sum(np.square(x - self._centre)))

"""What the planner knows of a rig: the runs that it allows, how they are simulated, and what they would show."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd

from ...errors import ParameterError
from ..inference.gauss_newton import Fit

DESIGNS, FEW = 200, 30
"""Number of designs that are tried: usually, and for each change of the rig that nobody has declared."""


class Family(ABC):
    """The runs that a rig allows, within its limits: each has a kind, words, numbers and set points."""

    seconds: float
    runs: int
    options: ClassVar[str]
    """Options of the command line that widen the limits."""
    header: ClassVar[str]
    """First line of a file of its runs."""

    @property
    def each(self) -> float:
        """Length of each run, s."""
        return self.seconds / self.runs

    @property
    @abstractmethod
    def kinds(self) -> tuple[str, ...]:
        """The kinds of runs that are allowed."""

    @abstractmethod
    def draw(self, rng: np.random.Generator, kind: str) -> Any:
        """Draw a run of a kind."""

    @abstractmethod
    def near(self, rng: np.random.Generator, run: Any, share: float) -> Any:
        """Draw a run of the same kind close to another one, within a share of the limits."""

    def _refuse_times(self, least: float, most: float, expected: str) -> None:
        """Raise where the number of runs or the length of each is not allowed."""
        if not (isinstance(self.runs, int) and 1 <= self.runs <= 5):
            raise ParameterError(f"runs is {self.runs!r}.", "1 to 5 runs", "Ask for fewer; diagnose after each set.")
        if not least <= self.each <= most:
            raise ParameterError(
                f"{self.seconds:g} s shared by {self.runs} runs are {self.each:g} s each.",
                expected,
                "Give more seconds, or ask for fewer runs.",
            )


class Rig(ABC):
    """A bench, a system or any other simulator with its logs, for the planner."""

    limits: Any
    """The runs that it allows, a `Family`."""
    logs: Sequence[Any]
    """The logs of its present state, each with its simulator as evidence."""
    changes: Sequence[Mapping[str, float]] = ()
    """Changes of it that are possible."""

    @abstractmethod
    def recorded(self, runs: Sequence[Any], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with the indices of those that could be simulated."""

    @abstractmethod
    def evidence(self, table: pd.DataFrame) -> Any:
        """Return the evidence of a log, as `logs` are."""

    @property
    def designs(self) -> int:
        """Number of designs that are tried by default."""
        return DESIGNS

    @property
    def proposals(self) -> Sequence[Mapping[str, float]]:
        """Changes to try where none is declared and no run distinguishes."""
        return ()

    def changed(self, change: Mapping[str, float]) -> Self:
        """Return it after a change."""
        return self

    def library(self, effects: str | Sequence[str]) -> list[str]:
        """Return those of some effects that may act on it."""
        return list(effects)

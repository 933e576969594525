"""What a design needs to know about a rig: the runs that it can make, and how to simulate them with an explanation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from ..inference.gauss_newton import Fit


class AnyRun(Protocol):
    """A run of a rig's family."""

    kind: str
    seconds: float

    @property
    def words(self) -> str:
        """What the run is, for a reader."""
        ...

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers of the run."""
        ...

    def set_points(self, name: str) -> pd.DataFrame:
        """Return the references of the rig, sample by sample."""
        ...


class AnyLimits(Protocol):
    """What a rig allows."""

    @property
    def seconds(self) -> float:
        """Time of all runs together, s."""
        ...

    @property
    def runs(self) -> int:
        """Most runs."""
        ...

    @property
    def options(self) -> str:
        """Options of the command line that widen them."""
        ...

    @property
    def header(self) -> str:
        """First line of a file of its runs."""
        ...


class Rig(Protocol):
    """A rig, for a design."""

    @property
    def limits(self) -> Any:
        """What it allows."""
        ...

    @property
    def logs(self) -> Sequence[Any]:
        """The logs of its present state, each with its simulator as evidence."""
        ...

    @property
    def kinds(self) -> Sequence[str]:
        """The kinds of runs that there can be."""
        ...

    def draw(self, rng: np.random.Generator, kind: str) -> Any:
        """Draw a run of a kind."""
        ...

    def near(self, rng: np.random.Generator, run: Any, share: float) -> Any:
        """Draw a run close to another one, within a share of the limits."""
        ...

    def recorded(self, runs: Sequence[Any], truth: Fit) -> tuple[pd.DataFrame, list[int]]:
        """Return runs simulated with an explanation, with the indices of those that could be simulated."""
        ...

    def evidence(self, table: pd.DataFrame) -> Any:
        """Return the evidence of a log, as `logs` are."""
        ...

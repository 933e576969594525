"""What a design needs to know of a rig: the runs that it can make, and what an explanation would make of them."""

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
        """Return what the rig is told, sample by sample."""
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
    """A rig as a design sees it."""

    @property
    def limits(self) -> Any:
        """What it allows."""
        ...

    @property
    def logs(self) -> Sequence[Any]:
        """The logs of its present state, each held against its simulator."""
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
        """Return what an explanation makes of runs, with the places of those that could be simulated."""
        ...

    def evidence(self, table: pd.DataFrame) -> Any:
        """Return a log held against the simulator, as `logs` are."""
        ...

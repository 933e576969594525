"""One log of a simulator among others: the same starting values, units and names."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from ...remembered import Remembered
from ...simulators.base import Simulator
from ...simulators.catalogue import placements
from ...simulators.placement import Placement
from ...simulators.sizes import SignalSizes

if TYPE_CHECKING:
    from .protocol import Active
from .settled import Settled
from .tolerances import Tolerances


class Aside(NamedTuple):
    """A nuisance parameter that is fixed."""

    name: str
    skew: np.ndarray
    """What one tolerance of it adds to the residuals."""


class Beside(Tolerances, Settled, ABC):
    """What the evidence of a log at ports needs in order to be stacked with other logs of the simulator."""

    given: Simulator
    sizes: SignalSizes
    placements: Mapping[str, Placement]
    value: np.ndarray
    notes: list[str]
    _there: frozenset[str]
    _kept: Remembered[np.ndarray]
    _touches: dict[str, list[str]]
    _nuisances: np.ndarray | None = None
    _aside: Aside | None = None

    @abstractmethod
    def _begun(self, straight: np.ndarray) -> None:
        """Compute residuals and slopes at the present starting values."""

    @abstractmethod
    def _made_own(self) -> Active:
        """Return the simulator's own effects, made."""

    @abstractmethod
    def _twins(self) -> Mapping[str, str]:
        """Return the faults that commute with the simulator between them."""

    @property
    def lasting(self) -> Collection[str]:
        """The simulator's own parameters: a change of one between days is a cause."""
        return self.given.parameters.keys()

    def _placed(self) -> Mapping[str, Placement]:
        """Return every effect where it can act on the log."""
        return placements(self.simulator, self.sizes)

    def has(self, name: str) -> bool:
        """Return whether the log has the signals that an effect acts on."""
        return name in self._there

    def begin_as(self, other: Beside) -> None:
        """Begin from the parameters at which another log of the same simulator begins."""
        x = np.zeros(len(self.free))
        for k, name in enumerate(self.free):
            if name in self.lasting and name in other.free:
                x[k] = other.about[other.free.index(name)] - self.about[k]
        if np.any(x):
            straight = self.J
            self._begin_from(x)
            self._begun(straight)

    def measure_as(self, sizes: SignalSizes) -> None:
        """Scale each effect by the signals of several logs."""
        self.sizes = sizes
        self.placements = self._placed()
        self._there &= self.placements.keys()
        self.twins = self._twins()
        self._kept.clear()
        self._laid.clear()
        self._touches.clear()
        if self._own:
            notes, self._own = list(self.notes), self._made_own()
            self.notes = notes
            self._begun(self.J)

    @property
    def nuisances(self) -> np.ndarray:
        """Change of the residuals by one tolerance of this log's clocks and offsets, where they are not free."""
        return np.zeros((len(self.z0), 0)) if self._nuisances is None else self._nuisances

    def without_nuisances(self) -> None:
        """Fix clocks and offsets: two logs then have the same free parameters."""
        self._nuisances = self.J[:, [name not in self.lasting for name in self.free]]
        self._keep_free(self.lasting)

    def _keep_free(self, names: Collection[str]) -> None:
        """Fix all free parameters but some, where they are."""
        kept = np.array([name in names for name in self.free], dtype=bool)
        self.free = [name for name in self.free if name in names]
        self.about, self.J = self.about[kept], self.J[:, kept]
        self.skews = {name: column for name, column in self.skews.items() if name in names}
        self._laid.clear()

    def _set_aside(self, name: str) -> None:
        """Fix a nuisance parameter at zero; `stepped` frees it again."""
        self._aside = Aside(name, self.skews[name])
        self.value = self.value - self.about[self.free.index(name)] * self.skews[name]
        self.z0 = self.white(self.value / self.noise)
        self._keep_free([other for other in self.free if other != name])

    def stepped(self) -> Self | None:
        """Return this evidence with steps of an integrator free; None where they are, or where there are none."""
        if self._aside is None:
            return None
        name, skew = self._aside
        other = copy(self)
        other._aside, other._laid = None, Remembered(self._laid.most)  # slopes about effects have a column more
        other.free, other.about = [*self.free, name], np.append(self.about, 0.0)
        other.J, other.skews = np.column_stack([self.J, self.white(skew / self.noise)]), {**self.skews, name: skew}
        return other

    def also_under(self, names: Mapping[str, str]) -> None:
        """Add other names of effects, each with its own."""
        more = {other: replace(self.placements[k], key=other) for other, k in names.items() if k in self.placements}
        self.placements = {**self.placements, **more}

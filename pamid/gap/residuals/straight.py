"""Tolerances so narrow that parameters act linearly, for systems whose faults do not commute."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

import numpy as np

from ...effects import Effect
from .protocol import Spec


class Straight:
    """Methods of a `pamid.gap.residuals.protocol.ResidualSource` whose slopes are the same everywhere."""

    J: np.ndarray
    effects: Mapping[str, type[Effect]]
    curved = False
    one_sided = False
    pace = 1.0
    twins: Mapping[str, str] = MappingProxyType({})
    lasting: Collection[str] = ()

    @property
    def about(self) -> np.ndarray:
        """Starting deviations of the free parameters, in tolerances: the simulator as given."""
        return np.zeros(self.J.shape[1])

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and highest deviations of the free parameters."""
        return np.full(self.J.shape[1], -1.0), np.ones(self.J.shape[1])

    @property
    def nuisances(self) -> np.ndarray:
        """Change of the residuals by clocks and offsets that are not free: none."""
        return np.zeros((len(self.J), 0))

    def has(self, name: str) -> bool:
        """Return whether an effect has something to act on here."""
        return True

    def also_under(self, names: Mapping[str, str]) -> None:
        """Let effects also have other names, each with that of the library."""
        self.effects = {**self.effects, **{other: self.effects[name] for other, name in names.items()}}

    def slopes(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return the change of the residuals by one tolerance of each free parameter."""
        return self.J

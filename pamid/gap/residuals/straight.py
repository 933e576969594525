"""Tolerances so narrow that what parameters do is one linear model, of systems whose faults do not commute."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from .protocol import Spec


class Straight:
    """Answers of a `pamid.gap.residuals.protocol.ResidualSource` whose slopes are the same everywhere."""

    J: np.ndarray
    curved = False
    twins: Mapping[str, str] = MappingProxyType({})

    def slopes(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return the change of the residuals by one tolerance of each free parameter."""
        return self.J

"""Fine-tuning of all layers or of a few: the trained arrays are the network's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError
from .base import Arrays


@dataclass(frozen=True)
class FineTuning:
    """Train the named layers, counted from 0 at the input; ``None`` trains all of them."""

    layers: tuple[int, ...] | None = None

    def _trained(self, source: Arrays) -> list[int]:
        n = len(source) // 2
        layers = range(n) if self.layers is None else sorted(set(self.layers))
        if not layers or any(not 0 <= k < n for k in layers):
            raise ParameterError(
                f"The layers to train are {self.layers}.",
                f"at least one, each from 0 to {n - 1}",
                "Name layers that the network has.",
            )
        return [i for k in layers for i in (2 * k, 2 * k + 1)]

    def initial(self, source: Arrays, generator: np.random.Generator) -> Arrays:
        """Return the source's own arrays of the trained layers."""
        return [1.0 * source[i] for i in self._trained(source)]

    def expand(self, source: Arrays, psi: Arrays) -> Arrays:
        """Return the source with the trained layers put in."""
        theta = list(source)
        for i, p in zip(self._trained(source), psi, strict=True):
            theta[i] = p
        return theta

    def pullback(self, source: Arrays, psi: Arrays, gradient: Arrays) -> Arrays:
        """Return the trained layers' part of the gradient."""
        return [gradient[i] for i in self._trained(source)]

    def rates(self, psi: Arrays) -> list[float]:
        """Return 1 for each array."""
        return [1.0] * len(psi)

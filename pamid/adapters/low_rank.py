"""LoRA: a product of two thin matrices is added to the weights of a layer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError
from .base import Arrays


def _like(values: np.ndarray, array: Any) -> Any:
    """Return the values as the kind of array that the network holds (type and device)."""
    return array.new_tensor(values) if hasattr(array, "new_tensor") else values.astype(array.dtype)


@dataclass(frozen=True)
class LowRank:
    """Add ``B A`` of the given rank to each layer's weights, from the input on; 0 leaves a layer as it is.

    A is drawn at random and B starts at zero, so the adaptation starts at the source. The default ranks count the
    1,288 parameters of the published table on the published network.
    """

    ranks: tuple[int, ...] = (2, 4)

    def _layers(self, source: Arrays) -> list[tuple[int, int]]:
        n = len(source) // 2
        if len(self.ranks) > n or any(r < 0 for r in self.ranks) or not any(self.ranks):
            raise ParameterError(
                f"The ranks are {self.ranks}.",
                f"at most {n} ranks, none below 0 and one above it",
                "Give one rank for each layer to adapt, from the input on.",
            )
        for k, r in enumerate(self.ranks):
            if r > min(source[2 * k].shape):
                raise ParameterError(
                    f"The rank of layer {k} is {r}.",
                    f"at most {min(source[2 * k].shape)}, the rank of its weights",
                    "Lower the rank, or fine-tune the whole layer.",
                )
        return [(2 * k, r) for k, r in enumerate(self.ranks) if r]

    def initial(self, source: Arrays, generator: np.random.Generator) -> Arrays:
        """Return ``[A1, B1, A2, B2, ...]`` of the adapted layers."""
        psi = []
        for i, r in self._layers(source):
            n_in = source[i].shape[1]
            psi += [_like(generator.normal(size=(r, n_in)) / np.sqrt(n_in), source[i]), 0.0 * source[i][:, :r]]
        return psi

    def expand(self, source: Arrays, psi: Arrays) -> Arrays:
        """Return the source with ``W + B A`` in the adapted layers."""
        theta = list(source)
        for j, (i, _) in enumerate(self._layers(source)):
            theta[i] = source[i] + psi[2 * j + 1] @ psi[2 * j]
        return theta

    def pullback(self, source: Arrays, psi: Arrays, gradient: Arrays) -> Arrays:
        """Return the gradients by A and B."""
        out = []
        for j, (i, _) in enumerate(self._layers(source)):
            out += [psi[2 * j + 1].T @ gradient[i], gradient[i] @ psi[2 * j].T]
        return out

    def rates(self, psi: Arrays) -> list[float]:
        """Return 1 for each array."""
        return [1.0] * len(psi)

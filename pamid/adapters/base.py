"""What an adapter is: a few parameters psi that expand to all parameters of the network."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

Arrays = list[Any]
"""Weights and biases in turn, ``[W1, c1, W2, c2, ...]``, numpy arrays or torch tensors; never altered in place."""


class Adapter(Protocol):
    """A reparametrisation ``theta = expand(source, psi)`` of a source network's parameters."""

    def initial(self, source: Arrays, generator: np.random.Generator) -> Arrays:
        """Return the psi where the adaptation starts."""
        ...

    def expand(self, source: Arrays, psi: Arrays) -> Arrays:
        """Return the network's parameters."""
        ...

    def pullback(self, source: Arrays, psi: Arrays, gradient: Arrays) -> Arrays:
        """Return the gradient by psi from the gradient by the network's parameters."""
        ...

    def rates(self, psi: Arrays) -> list[float]:
        """Return a factor on the learning rate for each array of psi."""
        ...


def n_parameters(psi: Arrays) -> int:
    """Return the number of trained values in psi."""
    return sum(int(np.prod(tuple(p.shape))) for p in psi)

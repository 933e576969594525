"""Fine-tuning of all layers or of a few: the trained arrays are the network's own."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..errors import ParameterError
from .base import Adapter, Arrays


@dataclass(frozen=True)
class FineTuning(Adapter):
    """Train the named layers, counted from 0 at the input; ``None`` trains all of them.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.base import n_parameters
    >>> from pamid.adapters.fine_tuning import FineTuning
    >>> source = [np.ones((3, 4)), np.zeros(3), np.ones((1, 3)), np.zeros(1)]  # a network 4-3-1
    >>> psi = FineTuning((0,)).initial(source, np.random.default_rng(0))
    >>> n_parameters(psi)
    15
    """

    layers: tuple[int, ...] | None = None

    name: ClassVar[str] = "full"

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

    def pushforward(self, source: Arrays, psi: Arrays, step: Arrays) -> Arrays:
        """Return the step of the trained layers, zeros elsewhere."""
        out = [0.0 * a for a in source]
        for i, s in zip(self._trained(source), step, strict=True):
            out[i] = s
        return out

    def gram(self, source: Arrays, psi: Arrays, adjoint: Arrays, tape: Any) -> Any:
        """Return the trained layers' part of the network's Gram matrix."""
        from ..training.network import gram

        trained = {i // 2 for i in self._trained(source)}
        return gram(adjoint, tape, [k in trained for k in range(len(source) // 2)])

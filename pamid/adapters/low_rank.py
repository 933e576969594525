"""LoRA: a product of two thin matrices is added to the weights of a layer."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..errors import ParameterError
from .base import Adapter, Arrays


def _like(values: np.ndarray, array: Any) -> Any:
    """Return the values as the kind of array that the network holds (type and device)."""
    return array.new_tensor(values) if hasattr(array, "new_tensor") else values.astype(array.dtype)


@dataclass(frozen=True)
class LowRank(Adapter):
    """Add ``B A`` of the given rank to each layer's weights, from the input on; 0 leaves a layer as it is.

    A is drawn at random and B starts at zero, so the adaptation starts at the source. The default ranks count the
    1,288 parameters of the published table on the published network.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.base import n_parameters
    >>> from pamid.adapters.low_rank import LowRank
    >>> source = [np.ones((3, 4)), np.zeros(3), np.ones((1, 3)), np.zeros(1)]  # a network 4-3-1
    >>> psi = LowRank((1,)).initial(source, np.random.default_rng(0))
    >>> n_parameters(psi)
    7
    """

    ranks: tuple[int, ...] = (2, 4)

    name: ClassVar[str] = "low_rank"

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

    def pushforward(self, source: Arrays, psi: Arrays, step: Arrays) -> Arrays:
        """Return ``dB A + B dA`` in the adapted layers, zeros elsewhere."""
        out = [0.0 * a for a in source]
        for j, (i, _) in enumerate(self._layers(source)):
            (A, B), (dA, dB) = psi[2 * j : 2 * j + 2], step[2 * j : 2 * j + 2]
            out[i] = dB @ A + B @ dA
        return out

    def gram(self, source: Arrays, psi: Arrays, adjoint: Arrays, tape: Any) -> Any:
        """Return the Gram matrix of A and B: that of a layer with B before its adjoints, or A behind its inputs."""
        from ..training.network import add_layer_gram, read_by_law

        out = 0.0 * tape.y[:, None] * tape.y
        pairs = read_by_law(adjoint, tape)
        for j, (i, _) in enumerate(self._layers(source)):
            G, H = pairs[i // 2]
            A, B = psi[2 * j : 2 * j + 2]
            add_layer_gram(out, G @ B, H, bias=False)
            add_layer_gram(out, G, H @ A.T, bias=False)
        return out

"""What an adapter is: a few parameters psi that expand to all parameters of the network."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from ..explained import explained_fields

Arrays = list[Any]
"""Weights and biases in turn, ``[W1, c1, W2, c2, ...]``, numpy arrays or torch tensors; never altered in place."""


@runtime_checkable
class Adapter(Protocol):
    r"""A reparametrisation ``theta = expand(source, psi)`` of a source network's parameters.

    With :math:`E = \partial\theta/\partial\psi`: `pullback` is :math:`E^T g`, `pushforward` is :math:`E s`, and `gram`
    is :math:`(J E)(J E)^T` for the Jacobian J of predictions by theta.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.low_rank import LowRank
    >>> source = [np.ones((3, 4)), np.zeros(3), np.ones((1, 3)), np.zeros(1)]
    >>> adapter = LowRank((1,))
    >>> theta = adapter.expand(source, adapter.initial(source, np.random.default_rng(0)))
    >>> bool((theta[0] == source[0]).all())  # an adaptation starts at the source
    True
    """

    name: ClassVar[str]
    """Name by which estimators and searches refer to it."""

    def initial(self, source: Arrays, generator: np.random.Generator) -> Arrays:
        """Return the psi where the adaptation starts."""
        ...

    def expand(self, source: Arrays, psi: Arrays) -> Arrays:
        """Return the network's parameters."""
        ...

    def pullback(self, source: Arrays, psi: Arrays, gradient: Arrays) -> Arrays:
        """Return the gradient by psi from the gradient by the network's parameters."""
        ...

    def pushforward(self, source: Arrays, psi: Arrays, step: Arrays) -> Arrays:
        """Return the change of the network's parameters that a change of psi makes."""
        ...

    def gram(self, source: Arrays, psi: Arrays, adjoint: Arrays, tape: Any) -> Any:
        """Return the Gram matrix of the predictions' gradients by psi, shape (n_samples, n_samples)."""
        ...

    def rates(self, psi: Arrays) -> list[float]:
        """Return a factor on the learning rate for each array of psi, 1 by default."""
        return [1.0] * len(psi)


@explained_fields
@dataclass(frozen=True)
class Bound:
    """An adapter on its source, as a trainer takes it (`pamid.training.reparametrisation`).

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.base import Bound
    >>> from pamid.adapters.scalar import Scalar
    >>> source = [np.ones((3, 4)), np.zeros(3), np.ones((1, 3)), np.zeros(1)]
    >>> bound = Bound(Scalar(4.0), source)
    >>> psi = bound.adapter.initial(source, np.random.default_rng(0))
    >>> float(bound.expand(psi)[-2][0, 0])
    4.0
    """

    adapter: Annotated[Adapter, "The adapter."]
    source: Annotated[Arrays, "Parameters of the source network, of the kind and on the device of the training."]

    def expand(self, psi: Arrays) -> Arrays:
        """Return the network's parameters."""
        return self.adapter.expand(self.source, psi)

    def pullback(self, psi: Arrays, gradient: Arrays) -> Arrays:
        """Return the gradient by psi."""
        return self.adapter.pullback(self.source, psi, gradient)

    def pushforward(self, psi: Arrays, step: Arrays) -> Arrays:
        """Return the change of the network's parameters."""
        return self.adapter.pushforward(self.source, psi, step)

    def gram(self, psi: Arrays, adjoint: Arrays, tape: Any) -> Any:
        """Return the Gram matrix of the predictions' gradients by psi."""
        return self.adapter.gram(self.source, psi, adjoint, tape)

    def rates(self, psi: Arrays) -> list[float]:
        """Return a factor on the learning rate for each array of psi."""
        return self.adapter.rates(psi)


def n_parameters(psi: Arrays) -> int:
    """Return the number of trained values in psi.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.base import n_parameters
    >>> n_parameters([np.zeros((3, 4)), np.zeros(3)])
    15
    """
    return sum(int(np.prod(tuple(p.shape))) for p in psi)

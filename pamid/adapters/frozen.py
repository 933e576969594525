"""Nothing of the network is trained: what stands over it, such as a factor on the volume, is adapted alone."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from .base import Adapter, Arrays


@dataclass(frozen=True)
class Frozen(Adapter):
    """Leave the network as it is.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.base import n_parameters
    >>> from pamid.adapters.frozen import Frozen
    >>> source = [np.ones((3, 4)), np.zeros(3), np.ones((1, 3)), np.zeros(1)]  # a network 4-3-1
    >>> psi = Frozen().initial(source, np.random.default_rng(0))
    >>> n_parameters(psi)
    0
    """

    name: ClassVar[str] = "frozen"

    def initial(self, source: Arrays, generator: np.random.Generator) -> Arrays:
        """Return no arrays."""
        return []

    def expand(self, source: Arrays, psi: Arrays) -> Arrays:
        """Return the source."""
        return list(source)

    def pullback(self, source: Arrays, psi: Arrays, gradient: Arrays) -> Arrays:
        """Return no arrays."""
        return []

    def pushforward(self, source: Arrays, psi: Arrays, step: Arrays) -> Arrays:
        """Return zeros."""
        return [0.0 * a for a in source]

    def gram(self, source: Arrays, psi: Arrays, adjoint: Arrays, tape: Any) -> Any:
        """Return zeros."""
        return 0.0 * tape.y[:, None] * tape.y

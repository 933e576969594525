"""The Q-adapter: a factor on the volume, over any other adapter."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ..errors import ParameterError
from .base import Adapter, Arrays
from .fine_tuning import FineTuning


@dataclass(frozen=True)
class Scalar(Adapter):
    """Multiply the last layer's weights and bias, hence the volume, by Q; Q learns at `rate` of the learning rate.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.adapters.base import n_parameters
    >>> from pamid.adapters.scalar import Scalar
    >>> source = [np.ones((3, 4)), np.zeros(3), np.ones((1, 3)), np.zeros(1)]  # a network 4-3-1
    >>> psi = Scalar(4.0).initial(source, np.random.default_rng(0))
    >>> n_parameters(psi)
    20
    """

    q0: float = 1.0
    base: Adapter = field(default_factory=FineTuning)
    rate: float = 0.2

    name: ClassVar[str] = "scalar"

    def __post_init__(self) -> None:
        """Refuse a factor that makes no volume."""
        if not (np.isfinite(self.q0) and self.q0 > 0):
            raise ParameterError(
                f"The initial factor on the volume is {self.q0}.",
                "a finite number above 0",
                "Take the ratio of D^2 L of the two muscles.",
            )

    def initial(self, source: Arrays, generator: np.random.Generator) -> Arrays:
        """Return Q, of shape (1,), before the base's arrays."""
        return [0.0 * source[-1].reshape(-1)[:1] + self.q0, *self.base.initial(source, generator)]

    def expand(self, source: Arrays, psi: Arrays) -> Arrays:
        """Return the base's network with its output multiplied by Q."""
        theta = self.base.expand(source, psi[1:])
        return [*theta[:-2], theta[-2] * psi[0], theta[-1] * psi[0]]

    def pullback(self, source: Arrays, psi: Arrays, gradient: Arrays) -> Arrays:
        """Return the gradient by Q and by the base's arrays."""
        theta = self.base.expand(source, psi[1:])
        by_q = sum((g * t).sum() for g, t in zip(gradient[-2:], theta[-2:], strict=True))
        inner = [*gradient[:-2], gradient[-2] * psi[0], gradient[-1] * psi[0]]
        return [by_q.reshape(1), *self.base.pullback(source, psi[1:], inner)]

    def pushforward(self, source: Arrays, psi: Arrays, step: Arrays) -> Arrays:
        """Return the change by Q, which the last layer alone feels, and by the base's arrays."""
        theta = self.base.expand(source, psi[1:])
        inner = self.base.pushforward(source, psi[1:], step[1:])
        return [*inner[:-2], *(psi[0] * d + step[0] * t for d, t in zip(inner[-2:], theta[-2:], strict=True))]

    def gram(self, source: Arrays, psi: Arrays, adjoint: Arrays, tape: Any) -> Any:
        """Return the base's Gram matrix with Q in the last layer, and the outer product of the gradient by Q."""
        from ..training.network import jacobian_product

        theta = self.base.expand(source, psi[1:])
        by_q = jacobian_product(adjoint, tape, [*(0.0 * t for t in theta[:-2]), *theta[-2:]])
        inner = self.base.gram(source, psi[1:], [*adjoint[:-1], psi[0] * adjoint[-1]], tape)
        return inner + by_q[:, None] * by_q

    def rates(self, psi: Arrays) -> list[float]:
        """Return Q's share of the learning rate, then the base's."""
        return [self.rate, *self.base.rates(psi[1:])]

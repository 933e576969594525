"""What a trainer needs of a reparametrised network: fewer or other parameters psi than the network's own theta."""

from typing import Protocol

from torch import Tensor

from .network import Parameters, Tape, gram


class Reparametrisation(Protocol):
    r"""A map :math:`\theta = e(\psi)` with its derivative :math:`E = \partial\theta/\partial\psi`, both ways.

    First-order trainers need `pullback` alone, Gauss–Newton ones also `pushforward` and `gram`.
    """

    def expand(self, psi: Parameters) -> Parameters:
        """Return θ."""
        ...

    def pullback(self, psi: Parameters, gradient: Parameters) -> Parameters:
        """Return Eᵀ g: the gradient by ψ from that by θ."""
        ...

    def pushforward(self, psi: Parameters, step: Parameters) -> Parameters:
        """Return E s: the change of θ that a change of ψ makes."""
        ...

    def gram(self, psi: Parameters, adjoint: list[Tensor], tape: Tape) -> Tensor:
        """Return (J E)(J E)ᵀ, shape (n_samples, n_samples), from the adjoints and the tape of a pass at θ."""
        ...

    def rates(self, psi: Parameters) -> list[float]:
        """Return a factor on the learning rate for each array of ψ."""
        ...


class Identity:
    """The network's own parameters: θ = ψ."""

    def expand(self, psi: Parameters) -> Parameters:
        """Return ψ."""
        return psi

    def pullback(self, psi: Parameters, gradient: Parameters) -> Parameters:
        """Return the gradient."""
        return gradient

    def pushforward(self, psi: Parameters, step: Parameters) -> Parameters:
        """Return the step."""
        return step

    def gram(self, psi: Parameters, adjoint: list[Tensor], tape: Tape) -> Tensor:
        """Return J Jᵀ."""
        return gram(adjoint, tape)

    def rates(self, psi: Parameters) -> list[float]:
        """Return 1 for each array."""
        return [1.0] * len(psi)


IDENTITY = Identity()

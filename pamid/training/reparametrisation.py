"""What a trainer needs of a reparametrised network: fewer or other parameters psi than the network's own theta."""

from typing import Protocol

from torch import Tensor

from .network import Parameters, Tape, gram


class Reparametrisation(Protocol):
    r"""A map :math:`\theta = e(\psi)` with its derivative :math:`E = \partial\theta/\partial\psi`, both ways.

    By default the parameters are the network's own, θ = ψ. First-order trainers need `pullback` alone, Gauss–Newton
    ones also `pushforward` and `gram`.
    """

    def expand(self, psi: Parameters) -> Parameters:
        """Return θ."""
        return psi

    def pullback(self, psi: Parameters, gradient: Parameters) -> Parameters:
        """Return Eᵀ g: the gradient by ψ from that by θ."""
        return gradient

    def pushforward(self, psi: Parameters, step: Parameters) -> Parameters:
        """Return E s: the change of θ that a change of ψ makes."""
        return step

    def gram(self, psi: Parameters, adjoint: list[Tensor], tape: Tape) -> Tensor:
        """Return (J E)(J E)ᵀ, shape (n_samples, n_samples), from the adjoints and the tape of a pass at θ."""
        return gram(adjoint, tape)

    def rates(self, psi: Parameters) -> list[float]:
        """Return a factor on the learning rate for each array of ψ."""
        return [1.0] * len(psi)


class _Identity(Reparametrisation):
    """The network's own parameters."""


IDENTITY = _Identity()

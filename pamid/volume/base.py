"""What a volume model is: the gas volume of a muscle and its two derivatives."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from ..signals.state import Array, State


class VolumeJet(NamedTuple):
    """A volume and its derivatives at every sample.

    Parameters
    ----------
    V : array, shape (n_samples,)
        Gas volume, m³.
    V_eps : array, shape (n_samples,)
        ∂V/∂ε, m³.
    V_P : array, shape (n_samples,)
        ∂V/∂P, m³/Pa; zero for a volume that is a function of the contraction alone.
    """

    V: Array
    V_eps: Array
    V_P: Array


class VolumeModel(Protocol):
    """Anything that gives the gas volume of a muscle with its derivatives."""

    def jet(self, state: State) -> VolumeJet:
        """Return V, ∂V/∂ε and ∂V/∂P at each sample of ``state``."""
        ...

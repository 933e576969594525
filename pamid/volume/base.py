"""What a volume model is: the gas volume of a muscle and its two derivatives."""

from typing import Annotated, NamedTuple, Protocol

from ..explained import explained_fields
from ..signals.state import Array, State


@explained_fields
class VolumeJet(NamedTuple):
    """A volume and its derivatives at every sample.

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.braided import BraidedVolume
    >>> jet = BraidedVolume(rest_length=0.2, rest_diameter=0.02, braid_angle=0.4363).jet(State(0.1, 0.0, 3e5, 0.0))
    >>> print(f"V = {1e6 * jet.V:.1f} cm³, its slope over the contraction {1e6 * jet.V_eps:.1f} cm³")
    V = 106.0 cm³, its slope over the contraction 350.4 cm³
    """

    V: Annotated[Array, "Gas volume, m³; an array of shape (n_samples,)."]
    V_eps: Annotated[Array, "∂V/∂ε, m³; an array of shape (n_samples,)."]
    V_P: Annotated[
        Array,
        "∂V/∂P, m³/Pa; zero for a volume that is a function of the contraction alone; an array of shape (n_samples,).",
    ]


class VolumeModel(Protocol):
    """Anything that gives the gas volume of a muscle with its derivatives.

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume import VolumeJet
    >>> class Balloon:
    ...     'A volume that grows with the pressure alone.'
    ...     def jet(self, state):
    ...         return VolumeJet(1e-10 * state.P, 0.0 * state.P, 1e-10 + 0.0 * state.P)
    >>> Balloon().jet(State(0.1, 0.0, 3e5, 0.0)).V  # m³
    3e-05
    """

    def jet(self, state: State) -> VolumeJet:
        """Return V, ∂V/∂ε and ∂V/∂P at each sample of ``state``."""
        ...


def slope_of(volume: VolumeModel, state: State) -> Array:
    """Return ∂V/∂ε alone, m³, which a quasi-static force reads: by ``volume.slope_at`` where the volume has it.

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.base import slope_of
    >>> from pamid.volume.cylinder import CylinderVolume
    >>> tube = CylinderVolume(rest_length=0.2, rest_diameter=0.02)
    >>> bool(slope_of(tube, State(0.1, 0.0, 3e5, 0.0)) == tube.jet(State(0.1, 0.0, 3e5, 0.0)).V_eps)
    True
    """
    own = getattr(volume, "slope_at", None)
    return volume.jet(state).V_eps if own is None else own(state)

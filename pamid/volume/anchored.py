"""A geometric volume plus a network's correction that fades outside the data."""

from dataclasses import dataclass
from typing import Annotated

from ..explained import explained_fields
from ..signals.state import Array, State
from .base import VolumeJet, VolumeModel, slope_of


@explained_fields
@dataclass(frozen=True)
class AnchoredVolume:
    r"""Sum of a geometric anchor and a correction, :math:`V = V_\mathrm{geo} + V_\mathrm{net}`.

    The laws are linear in the volume, so the correction is trained on what the anchor leaves of the force or flow.

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.anchored import AnchoredVolume
    >>> from pamid.volume.braided import BraidedVolume
    >>> from pamid.volume.cylinder import CylinderVolume
    >>> geometry = BraidedVolume(rest_length=0.2, rest_diameter=0.02, braid_angle=0.4363)
    >>> tube = CylinderVolume(rest_length=0.2, rest_diameter=0.002)  # stands for a correction
    >>> print(f"{1e6 * AnchoredVolume(geometry, tube).jet(State(0.0, 0.0, 3e5, 0.0)).V:.2f} cm³")
    63.46 cm³
    """

    anchor: Annotated[VolumeModel, "The geometry."]
    correction: Annotated[VolumeModel, "The network, with its inputs clamped to the range of the data."]

    def jet(self, state: State) -> VolumeJet:
        """Return V, ∂V/∂ε and ∂V/∂P at each sample."""
        a, b = self.anchor.jet(state), self.correction.jet(state)
        return VolumeJet(a.V + b.V, a.V_eps + b.V_eps, a.V_P + b.V_P)

    def slope_at(self, state: State) -> Array:
        """Return ∂V/∂ε alone."""
        return slope_of(self.anchor, state) + slope_of(self.correction, state)

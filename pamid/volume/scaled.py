"""A volume model times a factor, plus a constant: one muscle's volume seen as another's."""

from dataclasses import dataclass
from typing import Annotated

from ..explained import explained_fields
from ..signals.state import Array, State
from .base import VolumeJet, VolumeModel, slope_of


@explained_fields
@dataclass(frozen=True)
class ScaledVolume:
    r"""Volume of a similar muscle, :math:`V = Q\,V_\mathrm{source} + V_d`.

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.braided import BraidedVolume
    >>> from pamid.volume.scaled import ScaledVolume
    >>> small = BraidedVolume(rest_length=0.2, rest_diameter=0.01, braid_angle=0.4363)
    >>> wide = ScaledVolume(small, factor=4.0, dead_volume=2e-6)
    >>> state = State(0.1, 0.0, 3e5, 0.0)
    >>> print(f"{1e6 * small.jet(state).V:.1f} cm³ becomes {1e6 * wide.jet(state).V:.1f} cm³")
    26.5 cm³ becomes 108.0 cm³
    """

    source: Annotated[VolumeModel, "Volume of the muscle that was identified."]
    factor: Annotated[float, "Q, dimensionless; for muscles of one shape the ratio of D² L."]
    dead_volume: Annotated[float, "V_d, volume of tubes and fittings, m³."] = 0.0

    def jet(self, state: State) -> VolumeJet:
        """Return V, ∂V/∂ε and ∂V/∂P at each sample."""
        V, V_eps, V_P = self.source.jet(state)
        return VolumeJet(self.factor * V + self.dead_volume, self.factor * V_eps, self.factor * V_P)

    def slope_at(self, state: State) -> Array:
        """Return ∂V/∂ε alone."""
        return self.factor * slope_of(self.source, state)

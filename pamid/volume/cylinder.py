"""Rigid cylinder with a piston: the plain yardstick, and the model of a pneumatic cylinder."""

from dataclasses import dataclass
from typing import ClassVar, Self

from ..signals.state import State
from .base import VolumeJet
from .classical import REST_DIAMETER, REST_LENGTH, ClassicalVolume, FitParameter, cylinder_volume


@dataclass(frozen=True)
class CylinderVolume(ClassicalVolume):
    r"""Volume of a cylinder that keeps its diameter.

    .. math:: V(\varepsilon) = \frac{\pi D_0^2}{4}\,L_0\,(1 - \varepsilon), \qquad F = -\frac{\pi D_0^2}{4}\,p

    It pushes: gauge pressure lengthens it, the tension is negative.

    Parameters
    ----------
    rest_length : float
        L₀, m.
    rest_diameter : float
        Bore D₀, m.

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.cylinder import CylinderVolume
    >>> jet = CylinderVolume.from_geometry(0.2, 0.02, 0.4363).jet(State(0.1, 0.0, 3e5, 0.0))
    >>> print(f"V = {1e6 * jet.V:.1f} cm³, its slope over the contraction {1e6 * jet.V_eps:.1f} cm³")
    V = 56.5 cm³, its slope over the contraction -62.8 cm³
    """

    rest_diameter: float

    name: ClassVar[str] = "cylinder"
    force_falls: ClassVar[bool] = False
    pulls: ClassVar[bool] = False
    parameters: ClassVar[tuple[FitParameter, ...]] = (REST_LENGTH, REST_DIAMETER)

    @classmethod
    def from_geometry(cls, rest_length: float, rest_diameter: float, braid_angle: float) -> Self:
        """Return the cylinder of this length and diameter (m); it has no braid."""
        return cls(rest_length, rest_diameter)

    def jet(self, state: State) -> VolumeJet:
        """Return V (m³), ∂V/∂ε (m³) and ∂V/∂P = 0 at each sample."""
        V0 = cylinder_volume(self.rest_length, self.rest_diameter)
        V = V0 * (1.0 - state.eps)
        return VolumeJet(V, -V0 + 0.0 * V, 0.0 * V)

"""Cylinder in an inextensible double-helix braid: Chou and Hannaford."""

from dataclasses import dataclass
from typing import ClassVar, Self

from ..constants import ATMOSPHERIC_PRESSURE
from ..explained import explained_by
from ..signals.state import Array, State
from .base import VolumeJet
from .classical import (
    BRAID_ANGLE,
    REST_DIAMETER,
    REST_LENGTH,
    ClassicalVolume,
    FitParameter,
    braid_factors,
    cylinder_volume,
)
from .functions import force


@dataclass(frozen=True)
class BraidedVolume(ClassicalVolume):
    r"""Volume of a cylinder whose threads keep their length.

    .. math:: V(\varepsilon) = \frac{b^2 L - L^3}{4\pi n^2}, \quad L = L_0 (1 - \varepsilon), \quad
        b = \frac{L_0}{\cos\theta_0}, \quad n = \frac{b \sin\theta_0}{\pi D_0}

    or, with the volume at rest :math:`V_0 = \pi D_0^2 L_0/4`,
    :math:`V = V_0 \left[(1-\varepsilon)/\sin^2\theta_0 - (1-\varepsilon)^3/\tan^2\theta_0\right]`.

    Parameters
    ----------
    rest_length : float
        L₀, m.
    rest_diameter : float
        D₀ = 2 r₀ at rest, m.
    braid_angle : float
        Angle θ₀ of the threads to the axis at rest, rad.

    References
    ----------
    C.-P. Chou, B. Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles", IEEE Transactions
    on Robotics and Automation 12(1), 1996. https://doi.org/10.1109/70.481753

    Examples
    --------
    >>> from pamid.signals.state import State
    >>> from pamid.volume.braided import BraidedVolume
    >>> muscle = BraidedVolume(rest_length=0.2, rest_diameter=0.02, braid_angle=0.4363)
    >>> round(float(1e6 * muscle.jet(State(0.0, 0.0, 3e5, 0.0)).V), 2)  # cm³
    62.83
    """

    rest_diameter: float
    braid_angle: float

    name: ClassVar[str] = "chou_hannaford"
    parameters: ClassVar[tuple[FitParameter, ...]] = (REST_LENGTH, REST_DIAMETER, BRAID_ANGLE)

    @classmethod
    def from_geometry(cls, rest_length: float, rest_diameter: float, braid_angle: float) -> Self:
        """Return the model of a muscle of this geometry (m, m, rad), further numbers at their defaults."""
        return cls(rest_length, rest_diameter, braid_angle)

    def jet(self, state: State) -> VolumeJet:
        """Return V (m³), ∂V/∂ε (m³) and ∂V/∂P = 0 at each sample."""
        stretch = 1.0 - state.eps
        V0 = cylinder_volume(self.rest_length, self.rest_diameter)
        a, b = braid_factors(self.braid_angle)
        square = a * stretch * stretch
        V = V0 * stretch * (b - square / 3.0)
        return VolumeJet(V, V0 * (square - b), 0.0 * V)


@explained_by(force, BraidedVolume)
def chou_hannaford(
    P: Array,
    eps: Array,
    *,
    rest_diameter: Array,
    braid_angle: Array,
    atmospheric_pressure: Array = ATMOSPHERIC_PRESSURE,
) -> Array:
    r"""Tension of a braided cylinder, whatever its length.

    .. math:: F = (P - P_\mathrm{atm})\,\frac{\pi D_0^2}{4}
        \left[\frac{3 (1-\varepsilon)^2}{\tan^2\theta_0} - \frac{1}{\sin^2\theta_0}\right]

    Examples
    --------
    >>> from pamid.volume.braided import chou_hannaford
    >>> print(f"{chou_hannaford(3e5, 0.1, rest_diameter=0.02, braid_angle=0.4363):.1f} N")
    348.1 N
    """
    muscle = BraidedVolume(1.0, rest_diameter, braid_angle)
    return (P - atmospheric_pressure) * muscle.jet(State(eps, 0.0 * eps, P, 0.0 * eps)).V_eps

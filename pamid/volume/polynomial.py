"""Polynomial volume: Itto and Kogiso, Hošovský and coworkers."""

from dataclasses import dataclass
from typing import ClassVar, Self

from ..signals.state import State
from .base import VolumeJet
from .classical import ClassicalVolume, braid_factors, cylinder_volume
from .hildebrandt import horner


@dataclass(frozen=True)
class PolynomialVolume(ClassicalVolume):
    r"""Volume that is a polynomial of the contraction.

    .. math:: V(\varepsilon) = \sum_{k=0}^{d} v_k\, \varepsilon^k

    Itto and Kogiso take a quadratic, Hošovský and coworkers a cubic.

    Parameters
    ----------
    rest_length : float
        L₀, m.
    coefficients : tuple of float
        v_0 ... v_d, m³.

    References
    ----------
    T. Itto, K. Kogiso, "Hybrid modeling of McKibben pneumatic artificial muscle systems", IEEE International
    Conference on Industrial Technology, 2011.

    A. Hošovský, J. Piteľ, K. Židek, "Enhanced dynamic model of pneumatic muscle actuator with Elman neural network",
    Abstract and Applied Analysis, 2015. https://doi.org/10.1155/2015/906126

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.polynomial import PolynomialVolume
    >>> jet = PolynomialVolume.from_geometry(0.2, 0.02, 0.4363).jet(State(0.1, 0.0, 3e5, 0.0))
    >>> print(f"V = {1e6 * jet.V:.1f} cm³, its slope over the contraction {1e6 * jet.V_eps:.1f} cm³")
    V = 106.0 cm³, its slope over the contraction 350.4 cm³
    """

    coefficients: tuple[float, ...]

    name: ClassVar[str] = "polynomial"
    force_falls: ClassVar[bool] = False
    pulls: ClassVar[bool] = False

    @classmethod
    def from_geometry(cls, rest_length: float, rest_diameter: float, braid_angle: float) -> Self:
        """Return the cubic that equals a braided cylinder of this geometry (m, m, rad)."""
        V0 = cylinder_volume(rest_length, rest_diameter)
        a, b = (float(c) for c in braid_factors(braid_angle))
        return cls(rest_length, (V0, V0 * (a - b), -V0 * a, V0 * a / 3.0))

    def jet(self, state: State) -> VolumeJet:
        """Return V (m³), ∂V/∂ε (m³) and ∂V/∂P = 0 at each sample."""
        slopes = tuple(k * v for k, v in enumerate(self.coefficients))[1:]
        V = horner(self.coefficients, state.eps)
        return VolumeJet(V, horner(slopes, state.eps), 0.0 * V)

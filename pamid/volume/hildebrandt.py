"""Polynomial effective area −dV/dL: Hildebrandt and coworkers."""

from dataclasses import dataclass
from typing import ClassVar, Self

from ..constants import ATMOSPHERIC_PRESSURE
from ..explained import explained_by
from ..signals.state import Array, State
from .base import VolumeJet
from .classical import ClassicalVolume, braid_factors, cylinder_volume
from .functions import force


def horner(coefficients: tuple[Array, ...], x: Array) -> Array:
    """Return Σ c_k x^k for the coefficients c_0, c_1, ... of one polynomial.

    Examples
    --------
    >>> from pamid.volume.hildebrandt import horner
    >>> horner((1.0, 2.0, 3.0), 2.0)
    17.0
    """
    total = 0.0 * x
    for c in reversed(coefficients):
        total = total * x + c
    return total


@dataclass(frozen=True)
class HildebrandtVolume(ClassicalVolume):
    r"""Volume with a polynomial effective area.

    .. math:: -\frac{\mathrm{d}V}{\mathrm{d}L} = A(\varepsilon) = \sum_{k=0}^{d} a_k \varepsilon^k, \qquad
        F = p\,A(\varepsilon), \qquad V = V_0 + L_0 \sum_{k=0}^{d} \frac{a_k\,\varepsilon^{k+1}}{k+1}

    Parameters
    ----------
    rest_length : float
        L₀, m.
    areas : tuple of float
        a_0 ... a_d, m².
    rest_volume : float, default=0
        V₀, m³; the force does not depend on it.

    References
    ----------
    A. Hildebrandt, O. Sawodny, R. Neumann, A. Hartmann, "Cascaded tracking control concept for pneumatic muscle
    actuators", European Control Conference, 2003.

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.hildebrandt import HildebrandtVolume
    >>> jet = HildebrandtVolume.from_geometry(0.2, 0.02, 0.4363).jet(State(0.1, 0.0, 3e5, 0.0))
    >>> print(f"V = {1e6 * jet.V:.1f} cm³, its slope over the contraction {1e6 * jet.V_eps:.1f} cm³")
    V = 106.0 cm³, its slope over the contraction 350.4 cm³
    """

    areas: tuple[float, ...]
    rest_volume: float = 0.0

    name: ClassVar[str] = "hildebrandt"
    force_falls: ClassVar[bool] = False
    pulls: ClassVar[bool] = False

    @classmethod
    def from_geometry(cls, rest_length: float, rest_diameter: float, braid_angle: float) -> Self:
        """Return the quadratic that equals a braided cylinder of this geometry (m, m, rad)."""
        area = cylinder_volume(1.0, rest_diameter)
        a, b = (float(c) for c in braid_factors(braid_angle))
        return cls(rest_length, (area * (a - b), -2.0 * area * a, area * a), area * rest_length)

    def jet(self, state: State) -> VolumeJet:
        """Return V (m³), ∂V/∂ε (m³) and ∂V/∂P = 0 at each sample."""
        raised = tuple(a / (k + 1) for k, a in enumerate(self.areas))
        V = self.rest_volume + self.rest_length * state.eps * horner(raised, state.eps)
        return VolumeJet(V, self.rest_length * horner(self.areas, state.eps), 0.0 * V)


@explained_by(force, HildebrandtVolume)
def hildebrandt(
    P: Array, eps: Array, *, areas: tuple[Array, ...], atmospheric_pressure: Array = ATMOSPHERIC_PRESSURE
) -> Array:
    r"""Tension with a polynomial effective area.

    .. math:: F = (P - P_\mathrm{atm}) \sum_k a_k \varepsilon^k

    Examples
    --------
    >>> from pamid.volume.hildebrandt import hildebrandt
    >>> print(f"{hildebrandt(3e5, 0.1, areas=(2.4e-3, -8e-3)):.1f} N")
    317.9 N
    """
    return (P - atmospheric_pressure) * horner(areas, eps)

"""Braided cylinder with a free power of the stretch: a form of our own in the spirit of Bou Saba and coworkers."""

from dataclasses import dataclass
from typing import ClassVar

from ..constants import ATMOSPHERIC_PRESSURE
from ..explained import explained_by
from ..laws._backend import namespace
from ..signals.state import Array, State
from .base import VolumeJet
from .braided import BraidedVolume
from .classical import FitParameter, braid_factors, cylinder_volume
from .functions import force


@explained_by(BraidedVolume)
@dataclass(frozen=True)
class BouSabaVolume(BraidedVolume):
    r"""Volume that follows from the force of a braided cylinder with a free exponent.

    .. math:: F = \pi r_0^2\, p \left[\frac{3 (1 - \varepsilon)^\nu}{\tan^2\theta_0} - \frac{1}{\sin^2\theta_0}\right]
        \quad\Rightarrow\quad
        V = V_0 \left[1 + \frac{3}{\tan^2\theta_0}\,\frac{1 - (1 - \varepsilon)^{\nu + 1}}{\nu + 1}
        - \frac{\varepsilon}{\sin^2\theta_0}\right]

    For ν = 2 this is Chou and Hannaford; a larger exponent lets the force fall faster, which stands for what the
    ideal cylinder leaves out (narrow ends, thickness of wall and threads).

    Parameters
    ----------
    exponent : float, default=2
        ν, dimensionless.

    Notes
    -----
    The published text was not at hand, and no equation of it is claimed here. The form is ours, in the spirit of the
    virtual-work models with which the paper is cited: a braided cylinder whose square is freed to a power, and only
    the part of the force that the gas does. Passive forces of the bladder, functions of the contraction alone, are no
    volume and are left out. Hold it against the paper before reporting results under its name.

    References
    ----------
    D. Bou Saba, E. Bideaux, X. Brun, P. Massioni, "A complete model of a two degree of freedom platform actuated by
    three pneumatic muscles elaborated for control synthesis", Symposium on Fluid Power and Motion Control, 2016.

    D. Bou Saba, P. Massioni, E. Bideaux, X. Brun, "Flatness-based control of a two-degree-of-freedom platform with
    pneumatic artificial muscles", 2017. https://doi.org/10.48550/arXiv.1703.05503

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.bou_saba import BouSabaVolume
    >>> jet = BouSabaVolume.from_geometry(0.2, 0.02, 0.4363).jet(State(0.1, 0.0, 3e5, 0.0))
    >>> print(f"V = {1e6 * jet.V:.1f} cm³, its slope over the contraction {1e6 * jet.V_eps:.1f} cm³")
    V = 106.0 cm³, its slope over the contraction 350.4 cm³
    """

    exponent: float = 2.0

    name: ClassVar[str] = "bou_saba"
    parameters: ClassVar[tuple[FitParameter, ...]] = (
        *BraidedVolume.parameters,
        FitParameter("exponent", "-", 0.5, 8.0, True, "power ν of the stretch"),
    )

    def jet(self, state: State) -> VolumeJet:
        """Return V (m³), ∂V/∂ε (m³) and ∂V/∂P = 0 at each sample; needs ε < 1."""
        xp = namespace(state.eps)
        stretch = 1.0 - state.eps
        V0 = cylinder_volume(self.rest_length, self.rest_diameter)
        a, b = braid_factors(self.braid_angle)
        # below a length of 1 % of the rest the power is not real or not finite: it stops there
        held = xp.where(stretch > 0.01, stretch, 0.01 + 0.0 * stretch)
        V = V0 * (1.0 + a * (1.0 - held ** (self.exponent + 1.0)) / (self.exponent + 1.0) - b * state.eps)
        return VolumeJet(V, V0 * (a * held**self.exponent - b), 0.0 * V)


@explained_by(force, BouSabaVolume)
def bou_saba(
    P: Array,
    eps: Array,
    *,
    rest_diameter: Array,
    braid_angle: Array,
    exponent: Array = 2.0,
    atmospheric_pressure: Array = ATMOSPHERIC_PRESSURE,
) -> Array:
    r"""Static tension of a braided cylinder with a free exponent, the gas part; a form of our own, see `BouSabaVolume`.

    .. math:: F = \pi r_0^2 (P - P_\mathrm{atm})
        \left[\frac{3 (1 - \varepsilon)^\nu}{\tan^2\theta_0} - \frac{1}{\sin^2\theta_0}\right]

    Examples
    --------
    >>> from pamid.volume.bou_saba import bou_saba
    >>> print(f"{bou_saba(3e5, 0.1, rest_diameter=0.02, braid_angle=0.4363, exponent=2.2):.1f} N")
    333.6 N
    """
    muscle = BouSabaVolume(1.0, rest_diameter, braid_angle, exponent)
    return (P - atmospheric_pressure) * muscle.jet(State(eps, 0.0 * eps, P, 0.0 * eps)).V_eps

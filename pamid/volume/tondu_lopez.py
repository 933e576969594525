"""Braided cylinder with conical ends and braid friction: Tondu and Lopez."""

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

PRESSURE_SCALE = 1e5
"""Gauge pressure over which the end-cap correction decays, Pa: exp(−p) as quoted, read with p in bar."""


@explained_by(BraidedVolume)
@dataclass(frozen=True)
class TonduLopezVolume(BraidedVolume):
    r"""Volume that follows from the static force of Tondu and Lopez.

    .. math:: F = \pi r_0^2\, p \left[a (1 - k\varepsilon)^2 - b\right], \quad a = \frac{3}{\tan^2\theta_0}, \quad
        b = \frac{1}{\sin^2\theta_0}, \quad k = a_k e^{-p/p_0} + b_k

    with the gauge pressure :math:`p = P - P_\mathrm{atm}` and :math:`p_0` = 1 bar. The muscle's ends stay narrow while
    its middle widens; k > 1 stands for the contraction that this costs. Integrating F dL = −p dV from the rest volume
    :math:`V_0 = \pi r_0^2 L_0` at a fixed pressure gives

    .. math:: V = V_0 \left[1 + a\,\frac{1 - (1 - k\varepsilon)^3}{3 k} - b\,\varepsilon\right]

    which for k = 1 is the volume of Chou and Hannaford.

    Parameters
    ----------
    end_cap : float, default=1
        b_k: k at high pressure, dimensionless.
    end_cap_rise : float, default=0
        a_k: what k gains at zero gauge pressure, dimensionless.
    atmospheric_pressure : float, default=101325
        Pa, absolute.

    Notes
    -----
    The paper itself was not at hand. The static force is its form as later work commonly quotes it, with
    :math:`k = a_k e^{-p} + b_k` and p in bar; that p counts in bar is our reading. The volume is our integral of that
    force at fixed pressure, not an equation of the paper.

    References
    ----------
    B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE Control Systems
    Magazine 20(2), 2000. https://doi.org/10.1109/37.833638

    Examples
    --------
    >>> from pamid.signals import State
    >>> from pamid.volume.tondu_lopez import TonduLopezVolume
    >>> jet = TonduLopezVolume.from_geometry(0.2, 0.02, 0.4363).jet(State(0.1, 0.0, 3e5, 0.0))
    >>> print(f"V = {1e6 * jet.V:.1f} cm³, its slope over the contraction {1e6 * jet.V_eps:.1f} cm³")
    V = 106.0 cm³, its slope over the contraction 350.4 cm³
    """

    end_cap: float = 1.0
    end_cap_rise: float = 0.0
    atmospheric_pressure: float = ATMOSPHERIC_PRESSURE

    name: ClassVar[str] = "tondu_lopez"
    depends_on_pressure: ClassVar[bool] = True
    parameters: ClassVar[tuple[FitParameter, ...]] = (
        *BraidedVolume.parameters,
        FitParameter("end_cap", "-", 0.5, 2.5, True, "end-cap factor k at high pressure (b_k)"),
        FitParameter("end_cap_rise", "-", -2.0, 5.0, False, "what k gains at zero gauge pressure (a_k)"),
    )

    def jet(self, state: State) -> VolumeJet:
        """Return V (m³), ∂V/∂ε (m³) and ∂V/∂P (m³/Pa) at each sample."""
        xp = namespace(state.eps, state.P)
        eps = state.eps
        V0 = cylinder_volume(self.rest_length, self.rest_diameter)
        a, b = braid_factors(self.braid_angle)
        rise = self.end_cap_rise * xp.exp(0.0 * eps + (self.atmospheric_pressure - state.P) / PRESSURE_SCALE)
        k = self.end_cap + rise
        left = 1.0 - k * eps
        # (1 − (1 − kε)³)/(3k) without the division, so that k may pass through zero
        gained = eps * (1.0 + left + left * left) / 3.0
        gained_k = -(eps**2) * (1.0 + 2.0 * left) / 3.0
        return VolumeJet(
            V0 * (1.0 + a * gained - b * eps), V0 * (a * left * left - b), -V0 * a * gained_k * rise / PRESSURE_SCALE
        )


@explained_by(force, TonduLopezVolume)
def tondu_lopez(
    P: Array,
    eps: Array,
    *,
    rest_diameter: Array,
    braid_angle: Array,
    end_cap: Array = 1.0,
    end_cap_rise: Array = 0.0,
    atmospheric_pressure: Array = ATMOSPHERIC_PRESSURE,
) -> Array:
    r"""Static tension with the end-cap factor.

    .. math:: F = \pi r_0^2\, p \left[\frac{3 (1 - k\varepsilon)^2}{\tan^2\theta_0} - \frac{1}{\sin^2\theta_0}\right],
        \quad k = a_k e^{-p/p_0} + b_k, \quad p = P - P_\mathrm{atm}

    Examples
    --------
    >>> from pamid.volume.tondu_lopez import tondu_lopez
    >>> print(f"{tondu_lopez(3e5, 0.1, rest_diameter=0.02, braid_angle=0.4363, end_cap=1.1):.1f} N")
    332.7 N
    """
    muscle = TonduLopezVolume(1.0, rest_diameter, braid_angle, end_cap, end_cap_rise, atmospheric_pressure)
    return (P - atmospheric_pressure) * muscle.jet(State(eps, 0.0 * eps, P, 0.0 * eps)).V_eps


FRICTION_PARAMETERS = (
    FitParameter("static_friction_area", "m²", 0.0, 1e-2, True, "friction per gauge pressure at the start of motion"),
    FitParameter("kinetic_friction_area", "m²", 0.0, 1e-2, True, "friction per gauge pressure in fast motion"),
    FitParameter("stribeck_rate", "1/s", 1e-3, 1e2, False, "contraction rate over which the friction falls"),
)
"""Parameters of `braid_friction` that a fit may free."""


def braid_friction(
    deps: Array,
    p_gauge: Array,
    *,
    static_friction_area: Array,
    kinetic_friction_area: Array,
    stribeck_rate: Array = 0.1,
    smoothing_rate: Array = 1e-2,
) -> Array:
    r"""What the rubbing of thread on thread takes from the tension.

    .. math:: F_f = p \left[S_k + (S_s - S_k)\, e^{-|\dot\varepsilon|/\dot\varepsilon_s}\right]
        \tanh(\dot\varepsilon/\dot\varepsilon_0)

    a dry friction of three parameters after the description of the one of Tondu and Lopez: proportional to the
    pressure on the contacts, falling from a static to a kinetic coefficient with speed, and opposed to the motion (a
    muscle that shortens pulls less, the measured tension is F − F_f). The paper itself was not at hand, and the
    formula is ours. Two things differ from it as described: the contact area, there computed from the braid, is a
    constant that the two coefficients absorb, so that S is coefficient × contact area; and the sign of the speed is
    smoothed by tanh, so that the law can be simulated and differentiated.

    Parameters
    ----------
    deps : array, shape (n_samples,)
        Contraction rate ε̇, 1/s.
    p_gauge : array, shape (n_samples,)
        Gauge pressure, Pa.
    static_friction_area, kinetic_friction_area : float
        S_s and S_k, m² (N per Pa).
    stribeck_rate : float, default=0.1
        ε̇_s, 1/s.
    smoothing_rate : float, default=0.01
        ε̇₀, 1/s: below it the friction is partly mobilised.

    Returns
    -------
    array, shape (n_samples,)
        F_f, N: positive while the muscle shortens.

    References
    ----------
    B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE Control Systems
    Magazine 20(2), 2000. https://doi.org/10.1109/37.833638

    Examples
    --------
    >>> from pamid.volume.tondu_lopez import braid_friction
    >>> print(f"{braid_friction(0.2, 2e5, static_friction_area=4e-5, kinetic_friction_area=2e-5):.2f} N")
    4.54 N
    """
    xp = namespace(deps, p_gauge, static_friction_area, kinetic_friction_area, stribeck_rate)
    fall = xp.exp(-abs(deps) / stribeck_rate)
    area = kinetic_friction_area + (static_friction_area - kinetic_friction_area) * fall
    return p_gauge * area * xp.tanh(deps / smoothing_rate)

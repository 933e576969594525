"""Force and flow of any volume model as plain functions of the signals."""

from ..constants import ATMOSPHERIC_PRESSURE, GAS_CONSTANT, HEAT_CAPACITY_RATIO, TEMPERATURE
from ..laws.quasi_static import QuasiStaticForce
from ..laws.thermodynamic import ThermodynamicFlow
from ..signals.state import Array, State
from .classical import ClassicalVolume


def force(
    volume: ClassicalVolume, P: Array, eps: Array, *, atmospheric_pressure: float = ATMOSPHERIC_PRESSURE
) -> Array:
    r"""Tension of a muscle with this volume: :math:`F = (P - P_\mathrm{atm})/L_0 \cdot \partial V/\partial\varepsilon`.

    Parameters
    ----------
    volume : ClassicalVolume
        The volume model; gives the rest length, too.
    P : array, shape (n_samples,)
        Gas pressure, Pa, absolute.
    eps : array, shape (n_samples,)
        Contraction ratio, dimensionless.
    atmospheric_pressure : float, default=101325
        Pa, absolute.

    Returns
    -------
    array, shape (n_samples,)
        F, N.

    Examples
    --------
    >>> from pamid.volume.braided import BraidedVolume
    >>> from pamid.volume.functions import force
    >>> muscle = BraidedVolume(rest_length=0.2, rest_diameter=0.02, braid_angle=0.4363)
    >>> print(f"{force(muscle, P=3e5, eps=0.1):.1f} N")
    348.1 N
    """
    state = State(eps, 0.0 * eps, P, 0.0 * P)
    return QuasiStaticForce(volume.rest_length, atmospheric_pressure).predict(*volume.jet(state), state)


def flow(
    volume: ClassicalVolume,
    P: Array,
    dP: Array,
    eps: Array,
    deps: Array,
    *,
    heat_capacity_ratio: float = HEAT_CAPACITY_RATIO,
    gas_constant: float = GAS_CONSTANT,
    temperature: float = TEMPERATURE,
) -> Array:
    r"""Mass flow into a muscle with this volume: :math:`\dot m = \dot P V/(\gamma R T) + P \dot V/(R T)`.

    Parameters
    ----------
    volume : ClassicalVolume
        The volume model.
    P, dP : array, shape (n_samples,)
        Gas pressure (Pa, absolute) and its rate (Pa/s).
    eps, deps : array, shape (n_samples,)
        Contraction ratio (dimensionless) and its rate (1/s).
    heat_capacity_ratio, gas_constant, temperature : float
        γ, R in J/(kg K), T in K.

    Returns
    -------
    array, shape (n_samples,)
        ṁ, kg/s.

    Examples
    --------
    >>> from pamid.volume.braided import BraidedVolume
    >>> from pamid.volume.functions import flow
    >>> muscle = BraidedVolume(rest_length=0.2, rest_diameter=0.02, braid_angle=0.4363)
    >>> print(f"{1e3 * flow(muscle, P=3e5, dP=1e5, eps=0.1, deps=0.2):.3f} g/s")
    0.340 g/s
    """
    state = State(eps, deps, P, dP)
    return ThermodynamicFlow(heat_capacity_ratio, gas_constant, temperature).predict(*volume.jet(state), state)

r"""Gas in a chamber of changing volume, as functions of the volume and its rate.

`ThermodynamicFlow` states the same first law as a functional of a volume model; here the volume is already known, as
in a simulation or in the residual of a log.
"""

from ..constants import GAS_CONSTANT, HEAT_CAPACITY_RATIO, TEMPERATURE
from ..explained import explained_by
from ..signals.state import Array


def gas_mass(P: Array, V: Array, *, gas_constant: Array = GAS_CONSTANT, temperature: Array = TEMPERATURE) -> Array:
    r"""Mass of an ideal gas.

    .. math:: m = \frac{P V}{R T}

    Parameters
    ----------
    P : array, shape (n_samples,)
        Pressure, Pa, absolute.
    V : array, shape (n_samples,)
        Volume, m³.
    gas_constant : float or array, default=287
        R, J/(kg K).
    temperature : float or array, default=293
        T, K.

    Returns
    -------
    array, shape (n_samples,)
        Mass, kg.

    Examples
    --------
    >>> from pamid.laws.gas import gas_mass
    >>> print(f"{gas_mass(3e5, 7e-5):.3g} kg in 70 cm³ at 3 bar")
    0.00025 kg in 70 cm³ at 3 bar
    """
    return P * V / (gas_constant * temperature)


@explained_by(gas_mass)
def mass_flow(
    P: Array,
    dP: Array,
    V: Array,
    dV: Array,
    *,
    heat_capacity_ratio: Array = HEAT_CAPACITY_RATIO,
    gas_constant: Array = GAS_CONSTANT,
    temperature: Array = TEMPERATURE,
) -> Array:
    r"""Mass flow into a chamber whose pressure and volume change.

    .. math:: \dot m = \frac{\dot P V}{\gamma R T} + \frac{P \dot V}{R T}

    Parameters
    ----------
    P, dP : array, shape (n_samples,)
        Pressure (Pa, absolute) and its rate (Pa/s).
    V, dV : array, shape (n_samples,)
        Volume (m³) and its rate (m³/s).
    heat_capacity_ratio : float or array, default=1.4
        γ, dimensionless; 1 is an isothermal chamber, for which the flow is the rate of `gas_mass`.

    Returns
    -------
    array, shape (n_samples,)
        ṁ into the chamber, kg/s.

    References
    ----------
    E. Richer, Y. Hurmuzlu, "A high performance pneumatic force actuator system: Part I, nonlinear mathematical
    model", Journal of Dynamic Systems, Measurement, and Control 122(3), 2000. https://doi.org/10.1115/1.1286336

    Examples
    --------
    >>> from pamid.laws.gas import mass_flow
    >>> print(f"{mass_flow(3e5, 1e5, 7e-5, 0.0):.3g} kg/s for 1 bar/s at a constant volume")
    5.95e-05 kg/s for 1 bar/s at a constant volume
    """
    return (dP * V / heat_capacity_ratio + P * dV) / (gas_constant * temperature)


@explained_by(gas_mass, mass_flow)
def pressure_rate(
    P: Array,
    mdot: Array,
    V: Array,
    dV: Array,
    *,
    heat_capacity_ratio: Array = HEAT_CAPACITY_RATIO,
    gas_constant: Array = GAS_CONSTANT,
    temperature: Array = TEMPERATURE,
) -> Array:
    r"""Rate of the pressure that a mass flow brings about: `mass_flow` solved for Ṗ.

    .. math:: \dot P = \frac{\gamma}{V}\left(R T \dot m - P \dot V\right)

    Parameters
    ----------
    mdot : array, shape (n_samples,)
        Flow into the chamber, kg/s.
    V, dV : array, shape (n_samples,)
        Volume (m³) and its rate (m³/s).

    Returns
    -------
    array, shape (n_samples,)
        Ṗ, Pa/s.

    Examples
    --------
    >>> from pamid.laws.gas import mass_flow, pressure_rate
    >>> mdot = mass_flow(3e5, 1e5, 7e-5, 2e-5)
    >>> round(pressure_rate(3e5, mdot, 7e-5, 2e-5))  # Pa/s
    100000
    """
    return heat_capacity_ratio * (gas_constant * temperature * mdot - P * dV) / V


@explained_by(gas_mass, mass_flow)
def entropic_content(P: Array, V: Array, *, heat_capacity_ratio: Array = HEAT_CAPACITY_RATIO) -> Array:
    r"""Quantity whose rate is the flow alone: :math:`S = P^{1/\gamma} V`.

    The flow equation integrates exactly,

    .. math:: \frac{\mathrm{d}}{\mathrm{d}t}\left(P^{1/\gamma} V\right) = P^{1/\gamma - 1} R T\, \dot m,

    so that a log can be compared with it over a window without differentiating a noisy pressure: the change of S
    over the window is the integral of the right-hand side.

    Parameters
    ----------
    heat_capacity_ratio : float or array, default=1.4
        γ, dimensionless.

    Returns
    -------
    array, shape (n_samples,)
        P^{1/γ} V, Pa^{1/γ} m³.

    Examples
    --------
    >>> from pamid.laws.gas import entropic_content
    >>> P, V = 3e5, 7e-5
    >>> compressed = V / 2
    >>> round(entropic_content(P * 2**1.4, compressed) / entropic_content(P, V), 6)  # an adiabatic compression keeps it
    1.0
    """
    return P ** (1.0 / heat_capacity_ratio) * V

"""Servo valve after ISO 6358: the mass flow that a command lets through."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from ..constants import ATMOSPHERIC_PRESSURE, REFERENCE_DENSITY
from ..explained import explained_fields
from ..signals.state import Array
from ._backend import namespace


def flow_function(pressure_ratio: Array, critical_pressure_ratio: Array, linear_from: float | None = None) -> Array:
    r"""Share of the choked flow that passes an orifice, the elliptic flow function of ISO 6358.

    .. math:: \psi(x) = \begin{cases} 1 & x \le b_c \\ \sqrt{1 - \left(\frac{x - b_c}{1 - b_c}\right)^2} &
        b_c < x < 1 \\ 0 & x \ge 1 \end{cases}

    At x = 1 the slope of ψ is infinite: the flow is finite, but a Newton step or an implicit integrator stumbles and
    an autograd derivative is infinite. ``linear_from`` replaces the last stretch by the chord from there to
    ψ(1) = 0, the laminar stretch that simulators put there; the default keeps the ellipse to the end.

    Parameters
    ----------
    pressure_ratio : array, shape (n_samples,)
        Absolute pressure downstream over absolute pressure upstream, dimensionless. Values below 0 count as 0,
        above 1 as 1: no flow against the pressure.
    critical_pressure_ratio : float or array
        b_c, the ratio below which the flow is choked, dimensionless, 0 ≤ b_c < 1.
    linear_from : float, optional
        Ratio between b_c and 1, such as 0.999, above which ψ falls linearly to 0.

    Returns
    -------
    array, shape (n_samples,)
        ψ, from 0 to 1, dimensionless.

    References
    ----------
    ISO 6358-1:2013, "Pneumatic fluid power - Determination of flow-rate characteristics of components using
    compressible fluids".

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.laws.valve import flow_function
    >>> flow_function(np.array([0.2, 0.35, 0.8, 1.0]), 0.35).round(3)
    array([1.   , 1.   , 0.722, 0.   ])
    """
    xp = namespace(pressure_ratio, critical_pressure_ratio)
    x = xp.clip(pressure_ratio, 0.0, 1.0)
    if xp is np and linear_from is None:  # without gradients no case needs care
        fraction = np.maximum((x - critical_pressure_ratio) / (1.0 - critical_pressure_ratio), 0.0)
        return np.sqrt(1.0 - np.square(fraction))
    curved = x > critical_pressure_ratio
    if linear_from is not None:
        curved = curved & (x < linear_from)
    # The root is taken of a harmless number outside the curved part: autograd would otherwise meet 0 · ∞ there.
    fraction = xp.where(curved, (x - critical_pressure_ratio) / (1.0 - critical_pressure_ratio), 0.0 * x)
    under_root = 1.0 - fraction * fraction
    psi = xp.where(under_root > 0.0, xp.where(under_root > 0.0, under_root, 1.0 + 0.0 * x) ** 0.5, 0.0 * x)
    if linear_from is None:
        return psi
    at_start = (1.0 - ((linear_from - critical_pressure_ratio) / (1.0 - critical_pressure_ratio)) ** 2) ** 0.5
    return xp.where(x < linear_from, psi, at_start * (1.0 - x) / (1.0 - linear_from))


def valve_flow(
    u: Array,
    P: Array,
    supply_pressure: Array,
    atmospheric_pressure: Array = ATMOSPHERIC_PRESSURE,
    *,
    sonic_conductance: Array,
    critical_pressure_ratio: Array,
    reference_density: Array = REFERENCE_DENSITY,
    linear_from: float | None = None,
) -> Array:
    r"""Mass flow into a muscle through a servo valve.

    .. math:: \dot m = \begin{cases} +C\,u\,\rho_0\,P_s\,\psi(P/P_s) & u > 0 \\
        -C\,|u|\,\rho_0\,P\,\psi(P_\mathrm{atm}/P) & u < 0 \end{cases}

    Parameters
    ----------
    u : array, shape (n_samples,)
        Valve command, −1 (full vent) … 1 (full fill), dimensionless. It is not clipped: a bench that saturates
        says so as an effect.
    P : array, shape (n_samples,)
        Gas pressure in the muscle, Pa, absolute.
    supply_pressure : float or array
        P_s, Pa, absolute.
    atmospheric_pressure : float or array, default=101325
        P_atm, Pa, absolute.
    sonic_conductance : float or array
        C at full opening, m³/(s Pa).
    critical_pressure_ratio : float or array
        b_c, dimensionless.
    reference_density : float or array, default=1.185
        ρ₀ at the reference conditions of ISO 6358, kg/m³.
    linear_from : float, optional
        See `flow_function`.

    Returns
    -------
    array, shape (n_samples,)
        ṁ into the muscle, kg/s; never against the pressure.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.laws.valve import valve_flow
    >>> u, P = np.array([1.0, -1.0]), np.array([3e5, 3e5])
    >>> mdot = valve_flow(u, P, 7e5, sonic_conductance=6e-9, critical_pressure_ratio=0.35)
    >>> (1e3 * mdot).round(2)  # g/s, filling and venting at 3 bar
    array([ 4.94, -2.13])
    """
    xp = namespace(u, P, supply_pressure, atmospheric_pressure, sonic_conductance, critical_pressure_ratio)
    filling = supply_pressure * flow_function(P / supply_pressure, critical_pressure_ratio, linear_from)
    venting = P * flow_function(atmospheric_pressure / P, critical_pressure_ratio, linear_from)
    u = u + 0.0 * P
    return sonic_conductance * reference_density * u * xp.where(u > 0, filling, venting)


@explained_fields
@dataclass(frozen=True)
class Valve:
    """A servo valve between a supply and the surroundings, with its numbers.

    Examples
    --------
    >>> from pamid.laws.valve import Valve
    >>> valve = Valve(sonic_conductance=6e-9, critical_pressure_ratio=0.35, supply_pressure=7e5)
    >>> print(f"{1e3 * valve.flow(u=0.5, P=3e5):.2f} g/s")
    2.47 g/s
    """

    sonic_conductance: Annotated[float, "C at full opening, m³/(s Pa)."]
    critical_pressure_ratio: Annotated[float, "b_c, dimensionless."]
    supply_pressure: Annotated[float, "Pa, absolute."]
    atmospheric_pressure: Annotated[float, "Pa, absolute."] = ATMOSPHERIC_PRESSURE
    reference_density: Annotated[float, "ρ₀, kg/m³."] = REFERENCE_DENSITY
    linear_from: Annotated[
        float | None, "Pressure ratio above which the flow falls linearly to zero; see `flow_function`."
    ] = None

    equation: ClassVar[str] = "valve"
    target: ClassVar[str] = "mdot"
    unit: ClassVar[str] = "kg/s"

    def flow(self, u: Array, P: Array) -> Array:
        """Return ṁ into the muscle (kg/s) at command ``u`` and absolute pressure ``P`` (Pa)."""
        return valve_flow(
            u,
            P,
            self.supply_pressure,
            self.atmospheric_pressure,
            sonic_conductance=self.sonic_conductance,
            critical_pressure_ratio=self.critical_pressure_ratio,
            reference_density=self.reference_density,
            linear_from=self.linear_from,
        )

    def command(self, mdot: Array, P: Array) -> Array:
        """Return the command ``u`` that gives the flow ``mdot`` (kg/s) at absolute pressure ``P`` (Pa).

        The inverse of `flow`: infinite where the pressures allow no such flow, and not clipped to ±1.
        """
        xp = namespace(mdot, P)
        opened = xp.where(mdot > 0, self.flow(1.0 + 0.0 * P, P), -self.flow(-1.0 + 0.0 * P, P))
        at_rest = mdot == 0
        blocked = opened <= 0
        safe = xp.where(blocked, 1.0 + 0.0 * opened, opened)
        endless = xp.where(mdot > 0, safe * float("inf"), -safe * float("inf"))
        return xp.where(at_rest, 0.0 * P, xp.where(blocked, endless, mdot / safe))

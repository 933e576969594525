"""What a store of gas, liquid or heat gains and loses, and the supply that fills it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..laws.valve import flow_function
from ..signals.recursion import recursive
from ..signals.state import Array
from ._memory import drawn_along
from .base import Effect, FlowTerm, Signals
from .plant import Plant
from .values import parameter


class DeadVolume(Effect):
    r"""Fittings and tube that fill with the muscle but do no work.

    .. math:: \Delta\dot m = \frac{V_d\,\dot P}{\gamma R T}
    """

    name = "dead_volume"
    family = "gas"
    roles = ("pressure_rate",)
    source = "10.1115/1.1286336"
    volume = parameter("m^3", 0.0, 1e-3, 1e-5, "dead volume", linear=True)

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return (0, V_d/(γ R T))."""
        return FlowTerm(0.0, self.volume / (plant.heat_capacity_ratio * plant.RT))


class GasTemperature(Effect):
    r"""Gas warmer or colder than in the simulator: T → T + ΔT in the flow equation.

    .. math:: T' = T + \Delta T, \qquad C' = C\,\Big(1 - \sigma + \sigma\sqrt{T / T'}\Big)

    With σ = 1 the supplied gas has that temperature as well, and less of it passes the valve (ISO 6358).
    """

    name = "gas_temperature"
    family = "gas"
    equations = ("flow", "valve")
    source = "10.1115/1.1286336"
    difference = parameter("K", -80.0, 80.0, 10.0, "temperature above the nominal one", linear=True, symbol="ΔT")
    supplied = parameter("-", 0.0, 1.0, 0.0, "share of it that the supplied gas has as well", symbol="σ")

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed temperature and, for the supplied gas, conductance."""
        T = values["temperature"]
        passed = 1.0 - self.supplied + self.supplied * math.sqrt(T / (T + self.difference))
        return {"temperature": T + self.difference, "sonic_conductance": values["sonic_conductance"] * passed}


class PolytropicExponent(Effect):
    r"""Compression between isothermal (exponent 1) and adiabatic (1.4 for air).

    .. math:: \Delta\dot m = \frac{\dot P\,V}{R T}\left(\frac{1}{n_P} - \frac{1}{\gamma}\right), \qquad
        n_P = \gamma - (\gamma - n)\,(1 + \sigma\,\mathrm{sgn}\,\dot P)

    Filling and venting exchange heat differently: their exponents differ where σ is not 0.
    """

    name = "polytropic_exponent"
    family = "gas"
    roles = ("position", "pressure_rate")
    source = "10.1115/1.1286336"
    exponent = parameter("-", 1.0, 1.4, 1.2, "exponent of the compression", symbol="n")
    skew = parameter(
        "-", -0.5, 0.5, 0.0, "by how much it is further from adiabatic while the pressure rises", symbol="σ"
    )

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return (0, V/(R T) (1/n − 1/γ))."""
        adiabatic = plant.heat_capacity_ratio
        exponent = adiabatic - (adiabatic - self.exponent) * (1.0 + self.skew * np.sign(s.pressure_rate))
        return FlowTerm(0.0, plant.volume(s.position) / plant.RT * (1.0 / exponent - 1.0 / adiabatic))


class HeatTransfer(Effect):
    r"""Gas that warms when compressed and cools at the walls: adiabatic when fast, isothermal when slow.

    By the first law, with inflow at the temperature T of the walls and outflow at the gas's own, a muscle holds less
    gas by E than it would at that temperature,

    .. math:: \Delta\dot m = E\left(\frac{1}{\tau_P} + \kappa\,\omega\right), \qquad
        \dot E = \frac{\gamma - 1}{\gamma}\,\frac{V \dot P}{R T} - E\left(\frac{1}{\tau_P} +
        \kappa\,\omega\right), \qquad
        \omega = \max\left(0, -\frac{\dot P}{P} - \frac{\dot V}{V}\right), \qquad
        \tau_P = \tau \Big(\frac{P}{3\,P_a}\Big)^{\varsigma}

    for an excess of temperature E T/m that is small beside T. Gas that leaves, a share ω of it per second, takes its
    excess along: all of it (κ = 1), or less where it passes a hose at the temperature of the walls. With ς = 0 denser
    gas gives off more heat; with ς = 1 the conductance of the walls is constant, and more gas takes longer to cool.
    """

    name = "heat_transfer"
    family = "gas"
    roles = ("position", "velocity", "pressure", "pressure_rate")
    source = "10.1115/1.1286336"
    n_states = 1
    time_constant = parameter("s", 1e-3, 1e4, 0.2, "time constant of the cooling", symbol="τ")
    slowing = parameter("-", 0.0, 1.0, 0.0, "power with which the time constant grows with the pressure", symbol="ς")
    carried = parameter("-", 0.0, 1.0, 1.0, "share of its excess temperature that leaving gas keeps", symbol="κ")
    unknown = parameter("-", 0.0, 1.0, 0.0, "how much of what was before a run is unknown", before=True)

    def _rate(self, P: Array, plant: Plant) -> Array:
        """Return one over the time constant, 1/s."""
        return np.power(3.0 * plant.atmospheric_pressure / P, self.slowing) / self.time_constant

    def _gained(self, P0: Array, P1: Array, V: Array, plant: Plant) -> Array:
        """Return the missing gas that an adiabatic change of pressure adds, kg."""
        g = plant.heat_capacity_ratio
        return (g - 1.0) / g * V * (P1 - P0) / plant.RT

    def _lost(self, P0: Array, P1: Array, V0: Array, V1: Array, dt: float, plant: Plant) -> Array:
        """Return the logarithmic decrease of the excess by cooling and leaving gas over an interval."""
        left = self.carried * np.maximum(0.0, -np.log((P1 * V1) / (P0 * V0)))
        return dt * self._rate(0.5 * (P0 + P1), plant) + left

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return gas at the temperature of the walls: nothing is missing."""
        return np.stack([0.0 * s.pressure])

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Warm by compression, cool towards the walls."""
        V0, V1 = plant.volume(s0.position), plant.volume(s1.position)
        r = self._lost(s0.pressure, s1.pressure, V0, V1, dt, plant)
        return x * np.exp(-r) + self._gained(s0.pressure, s1.pressure, 0.5 * (V0 + V1), plant) * _mean_decay(r)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the missing gas along each run, without a loop over time."""
        P, V = np.asarray(s.pressure, dtype=float), np.asarray(plant.volume(s.position), dtype=float)
        drive, decay = np.zeros_like(P), np.zeros_like(P)
        r = self._lost(P[:-1], P[1:], V[:-1], V[1:], dt, plant)
        drive[1:] = self._gained(P[:-1], P[1:], 0.5 * (V[:-1] + V[1:]), plant) * _mean_decay(r)
        decay[1:] = np.exp(-r)
        drive[starts] = 0.0
        return _along(drive, decay, starts)[None]

    def beginnings(self, spans: Mapping[str, float], plant: Plant) -> tuple[tuple[str, float, float], ...]:
        """Return the decay of gas compressed or expanded from an initial pressure within the range."""
        volume = float(max(plant.volume(0.0), plant.volume(spans.get("position", 0.0))))
        missing = float(self._gained(0.0, spans.get("pressure", 0.0), volume, plant))
        size = self.unknown * missing / self.time_constant
        return (("flow", self.time_constant, size),) if size > 0.0 else ()

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the flow due to cooling, less that displaced by warm gas, kg/s."""
        widening = plant.volume_slope(s.position) * s.velocity / plant.volume(s.position)
        rate = s.pressure_rate / s.pressure + widening if s.flow is None else s.flow
        leaving = np.where(rate < 0.0, self.carried * x[0], 0.0)
        return FlowTerm(x[0] * self._rate(s.pressure, plant) - leaving * widening, -leaving / s.pressure)


def _mean_decay(r: Array) -> Array:
    """Return the mean of exp(−r t) for t from 0 to 1."""
    return -np.expm1(-r) / np.maximum(r, 1e-300)


def _along(drive: Array, decay: Array, starts: Array) -> Array:
    """Return the recursion of each column by its own decay."""
    if drive.ndim == 1:
        return recursive(drive, [decay], starts)
    return np.stack([recursive(drive[:, k], [decay[:, k]], starts) for k in range(drive.shape[1])], axis=1)


REFERENCE = 300.0
"""Temperature, K, at which the slope of the loss is stated."""


class HeatLoss(Effect):
    r"""Heat loss at a temperature port, by conduction (exponent 1), free convection (1 to 4) or radiation (4).

    .. math:: \dot T = -h\,\frac{T_r}{n}\Big[\Big(\frac{T}{T_r}\Big)^n - \Big(\frac{T_a}{T_r}\Big)^n\Big]

    above the temperature Tₐ of the surroundings, with Tᵣ = 300 K: n = 1 for conduction and fans, 4 for radiation.

    References
    ----------
    S. W. Churchill, H. H. S. Chu, "Correlating equations for laminar and turbulent free convection from a vertical
    plate", International Journal of Heat and Mass Transfer 18(11), 1975.
    https://doi.org/10.1016/0017-9310(75)90243-4
    """

    name = "heat_loss"
    family = "gas"
    roles = ("pressure",)
    kinds = ()  # at temperatures alone
    domain = "temperature"
    source = "10.1016/0017-9310(75)90243-4"
    coefficient = parameter("kg/(s Pa)", 0.0, 1e-3, 1e-7, "loss per kelvin at 300 K", linear=True, symbol="h")
    exponent = parameter("-", 1.0, 4.0, 4.0, "power of the absolute temperature", symbol="n", points=1)
    ambient = parameter("K", 230.0, 350.0, 293.15, "temperature of the surroundings", symbol="Tₐ", points=5)

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return the loss above the surroundings' temperature."""
        n = self.exponent
        above = np.maximum(s.pressure / REFERENCE, 0.0) ** n - (self.ambient / REFERENCE) ** n
        return FlowTerm(-self.coefficient * REFERENCE / n * np.maximum(above, 0.0), 0.0)


class Overflow(Effect):
    r"""Outflow above a level, as from an overflowing tank or an opening relief valve.

    .. math:: \Delta\dot m = -c\,\max(P - P_o, 0)

    References
    ----------
    M. Schoukens, J. P. Noël, "Three benchmarks addressing open challenges in nonlinear system identification",
    IFAC-PapersOnLine 50(1), 2017. https://doi.org/10.1016/j.ifacol.2017.08.071
    """

    name = "overflow"
    family = "gas"
    roles = ("pressure",)
    kinds = ("gas",)
    source = "10.1016/j.ifacol.2017.08.071"
    coefficient = parameter(
        "kg/(s Pa)", 0.0, 1e-3, 1e-8, "outflow per pressure above the level", linear=True, symbol="c"
    )
    level = parameter("Pa", 2e2, 2e6, 3e5, "where it begins", symbol="P_o")

    def flow(self, s: Signals, x: Array, plant: Plant) -> FlowTerm:
        """Return −c (P − P_o) above the level, kg/s."""
        return FlowTerm(-self.coefficient * np.maximum(s.pressure - self.level, 0.0), 0.0)


class PortOverflow(Overflow):
    r"""Outflow above a level, a share of which enters the next chamber.

    .. math:: \dot h = -c\,\max(h - h_o, 0), \qquad \dot h_\mathrm{next} = r\,c\,\max(h - h_o, 0)
    """

    returned = parameter("-", 0.0, 1.0, 0.0, "share that runs on")

    @classmethod
    def within(cls, low: float, high: float, fastest: float) -> type[Effect]:
        """Return the effect with its level within a range, and no faster than a coefficient."""
        rate, level, returned = cls.parameters
        edge = 0.02 * (high - low)
        slow = replace(rate, upper=min(rate.upper, fastest), nominal=min(rate.nominal, 0.1 * fastest))
        inside = replace(level, lower=low + edge, upper=high - edge, nominal=0.5 * (low + high), essential=True)
        return cls.narrowed(parameters=(slow, inside, returned))


_ROUNDS, _CLOSE = 40, 1e-12
"""Most rounds in which the flow and the pressure that it is drawn from are brought together, and when they are, as a
share of the supply pressure."""


class SupplyDroop(Effect):
    r"""Receiver behind a regulator, and a hose to each valve: the inlet pressure falls with the flow drawn.

    .. math:: P_s' = \frac{P_s - d}{1 + R_s k}, \qquad \tau\,\dot d = R_r \sum k\,P_s' - d, \qquad
        k = C\,u^+ \rho_0\,\psi\big(P/(P_s - d)\big)

    A valve draws the flow :math:`k P_s'`; the receiver feeds the valves of all muscles. The hose answers at once, the
    regulator lets the receiver recover in its time.

    References
    ----------
    ISO 6358-1:2013, "Pneumatic fluid power - Determination of flow-rate characteristics of components using
    compressible fluids"; ISO 6953-1:2015, "Pneumatic fluid power - Compressed air pressure regulators and
    filter-regulators", for the fall of a regulator's pressure with its flow.
    """

    name = "supply_droop"
    family = "valve"
    roles = ("command", "pressure")
    source = "ISO 6358-1:2013, ISO 6953-1:2015"
    n_states = 1
    resistance = parameter(
        "Pa s/kg", 0.0, 1e10, 2e7, "pressure lost in the hose per flow drawn", linear=True, symbol="R_s"
    )
    regulation = parameter(
        "Pa s/kg", 0.0, 1e10, 0.0, "fall of the regulated pressure per flow", linear=True, symbol="R_r"
    )
    time_constant = parameter("s", 1e-3, 5.0, 0.05, "time in which the receiver empties and recovers", symbol="τ")

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return a full receiver."""
        return np.zeros((1, *np.shape(s.command)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move towards the pressure at which the regulator replaces what the held command draws."""
        settled, rate = self._settling(x[0], s0.command, 0.5 * (s0.pressure + s1.pressure), plant, 0)
        return (settled + (x[0] - settled) * np.exp(-dt * rate))[None]

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the fall of the receiver's pressure along each run, without a loop over time."""
        u, P = np.asarray(s.command, dtype=float), np.asarray(s.pressure, dtype=float)
        d = np.zeros_like(u)
        if self.regulation == 0.0:
            return d[None]
        between = 0.5 * (P[:-1] + P[1:])
        for k in range(_ROUNDS):
            before, (settled, rate) = d, self._settling(d[:-1], u[:-1], between, plant, 1)
            d = drawn_along(settled, np.exp(-dt * rate), starts)
            if (
                k > _ROUNDS // 4
            ):  # near the pressure of the muscle the flow changes abruptly, and rounds go back and forth
                d = 0.5 * (d + before)
            if np.max(np.abs(d - before), initial=0.0) < _CLOSE * plant.supply_pressure:
                break
        return d[None]

    def supply(self, P_supply: Array, s: Signals, x: Array, plant: Plant) -> Array:
        """Return the pressure at the inlet, Pa."""
        k = self._conductance(s.command, s.pressure, P_supply - x[0], plant)
        return (P_supply - x[0]) / (1.0 + self.resistance * k)

    @staticmethod
    def _conductance(u: Array, P: Array, inlet: Array, plant: Plant) -> Array:
        """Return the flow that the valve draws per pressure at its inlet, kg/(s Pa)."""
        psi = flow_function(P / inlet, plant.critical_pressure_ratio)
        return np.asarray(plant.sonic_conductance * plant.reference_density * np.maximum(u, 0.0) * psi)

    def _settling(self, d: Array, u: Array, P: Array, plant: Plant, muscles: int) -> tuple[Array, Array]:
        """Return the final fall of pressure under held commands (Pa) and its rate (1/s), muscles along an axis."""
        k = self._conductance(u, P, plant.supply_pressure - d, plant)
        k = k / (1.0 + self.resistance * k)
        if k.ndim > muscles:
            k = np.broadcast_to(k.sum(axis=muscles, keepdims=True), k.shape)
        drawn = self.regulation * k
        return drawn / (1.0 + drawn) * plant.supply_pressure, (1.0 + drawn) / self.time_constant

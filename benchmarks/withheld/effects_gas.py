"""What the gas in a muscle does beyond the nominal first law."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .plant import Ingredient, Plant, flow_function
from .quantities import Numbers


class Leakage(Ingredient):
    """A leak to the room behind the flow meter: a sharp orifice, a laminar gap, or both in series of share."""

    name, family = "leakage", "gas"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        laminar = float(rng.choice([0.0, 1.0, rng.random()]))
        a = 0.01 * n.C * n.rho0
        return {"a": a, "lo": 1e-6 * a, "hi": 10 * a, "laminar": laminar, "b": float(rng.uniform(0.15, 0.5))}

    def gas(self, s: Any) -> None:
        p, Pa = self.p, s.plant.Pa
        orifice = s.P * flow_function(Pa / s.P, p.b)
        gap = (s.P**2 - Pa**2) / 3e5
        s.loss = s.loss + p.a * ((1.0 - p.laminar) * orifice + p.laminar * gap)


class HeatTransfer(Ingredient):
    """Gas of its own mass and temperature, with a conductance to the wall; the gas may leave as warm as it is.

    Conductance is given over the gas's heat capacity at rest: an inverse time constant, which falls as the mass grows.
    """

    name, family = "heat_transfer", "gas"
    rows = 2

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 1.0, "lo": 1e-6, "hi": 20.0, "own": float(rng.random() < 0.3), "forced": float(rng.uniform(0.0, 0.5)),
            "area": float(rng.uniform(0.0, 1.0)),
        }  # fmt: skip

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        L = plant.L0 * (1 - plant.eps0)
        self.V0 = plant.k * (plant.b2 * L - L**3)
        y[self.at] = y[2:4] * self.V0 / plant.RT0
        self.m0 = y[2] * self.V0 / plant.RT0
        self.own = self.p.own * self.p.a / (self.p.a + 0.1)  # no conductance, no effect

    def gas(self, s: Any) -> None:
        p, o = self.p, s.plant
        mass = s.y[self.at]
        T = s.P * s.V / (mass * o.R)
        cv = o.R / (o.gamma - 1.0)
        stirred = 1.0 + p.forced * np.abs(s.mdot) / (o.C * o.rho0 * 2e5)
        wall = (s.V / self.V0) ** (0.5 * p.area)
        s.heat = s.heat + p.a * self.m0 * cv * stirred * wall * (o.T - T)
        out = self.own * np.minimum(s.mdot, 0.0)  # enthalpy of what leaves at T instead of the supply's
        s.heat = s.heat + out * o.R * o.gamma / (o.gamma - 1.0) * (T - o.T)

    def rates(self, s: Any) -> Any:
        return s.mdot - s.loss


class PolytropicExponent(Ingredient):
    """An exponent below γ, a little different while the muscle fills and vents."""

    name, family = "polytropic_exponent", "gas"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.1, "lo": 1e-6, "hi": 0.38, "split": float(rng.uniform(-0.15, 0.15))}

    def gas(self, s: Any) -> None:
        p = self.p
        s.n = s.n - p.a * (1.0 + p.split * np.tanh(s.mdot / (0.02 * s.plant.C * s.plant.rho0 * 7e5)))


class DeadVolume(Ingredient):
    """Volume of fittings and hose, at the muscle's pressure, slightly soft."""

    name, family = "dead_volume", "gas"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        a = 0.1 * n.volume(n.eps0)
        return {"a": a, "lo": 1e-6 * a, "hi": 5 * a, "soft": float(rng.uniform(0.0, 0.05))}

    def shape(self, s: Any) -> None:
        p = self.p
        s.V = s.V + p.a * (1.0 + p.soft * s.gauge / 2e5)
        s.V_P = s.V_P + p.a * p.soft / 2e5


class GasTemperature(Ingredient):
    """Gas warmer or colder than stated, by an amount that drifts within a run; the valve may feel it."""

    name, family = "gas_temperature", "gas"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 8.0, "lo": 1e-4, "hi": 40.0, "sign": float(rng.choice([-1.0, 1.0])),
            "drift": float(rng.uniform(-0.15, 0.15)), "valve": float(rng.random() < 0.4),
        }  # fmt: skip

    rows = 1  # time

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        y[self.at] = 0.0

    def rates(self, s: Any) -> Any:
        return 1.0

    def warmer(self, s: Any) -> Any:
        p = self.p
        return p.sign * p.a * (1.0 + p.drift * np.minimum(s.y[self.at][0] / 4.0, 1.0))

    def gas(self, s: Any) -> None:
        s.RT = s.RT * (1.0 + self.warmer(s) / s.plant.T)

    def valve(self, s: Any) -> None:
        s.mdot = s.mdot * (1.0 + self.p.valve * (np.sqrt(s.plant.T / (s.plant.T + self.warmer(s))) - 1.0))


def log_uniform(rng: np.random.Generator, lo: float, hi: float) -> float:
    """Draw a number, uniform in its logarithm."""
    return float(np.exp(rng.uniform(math.log(lo), math.log(hi))))

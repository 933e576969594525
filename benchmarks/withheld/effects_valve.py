"""What the valves do beyond ISO 6358 at their command."""

from __future__ import annotations

from typing import Any

import numpy as np

from .effects_gas import log_uniform
from .plant import Ingredient, Plant
from .quantities import Numbers


class ValveDeadZone(Ingredient):
    """Overlap of the spool with round edges, wider on one side: the flow starts smoothly past it."""

    name, family = "valve_dead_zone", "valve"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 0.02, "lo": 1e-6, "hi": 0.12, "skew": float(rng.uniform(-0.3, 0.3)),
            "edge": float(rng.uniform(0.02, 0.3)),
        }  # fmt: skip

    def command(self, s: Any) -> None:
        p = self.p
        width = np.maximum(p.a * (1.0 + p.skew * np.sign(s.u)), 1e-12)
        x = np.abs(s.u) - width
        edge = p.edge * width
        past = 0.5 * (x + np.sqrt(x * x + edge * edge)) - 0.5 * (np.sqrt(width**2 + edge**2) - width)
        s.u = np.where(p.a > 0, np.sign(s.u) * np.maximum(past, 0.0), s.u)


class ValveSaturation(Ingredient):
    """The opening levels off before the full command; ``a`` is how much of full opening is missing."""

    name, family = "valve_saturation", "valve"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.15, "lo": 1e-5, "hi": 0.7, "sharp": float(rng.uniform(8.0, 30.0))}

    def command(self, s: Any) -> None:
        p = self.p
        # |u|/(1 + (|u|/c)^s)^(1/s) reaches 1 − a at full command.
        limit = (1.0 - np.minimum(p.a, 0.95)) ** (-p.sharp) - 1.0
        x = np.abs(s.u)
        s.u = s.u / (1.0 + np.maximum(limit, 0.0) * x**p.sharp) ** (1.0 / p.sharp)


class ValveAsymmetry(Ingredient):
    """Fills better than it vents, or the reverse."""

    name, family = "valve_asymmetry", "valve"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 0.1, "lo": 1e-6, "hi": 0.5, "sign": float(rng.choice([-1.0, 1.0])),
            "share": float(rng.uniform(0.2, 0.8)),
        }  # fmt: skip

    def command(self, s: Any) -> None:
        p = self.p
        fill, vent = 1.0 + p.sign * p.a * p.share, 1.0 - p.sign * p.a * (1.0 - p.share)
        s.u = s.u * np.where(s.u > 0, fill, vent)


class ValveLag(Ingredient):
    """A spool of second order: two lags in a row, the second a share of the first."""

    name, family = "valve_lag", "valve"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        # Less than a fraction of a sample is no lag that a valve has.
        return {"a": 0.004, "lo": log_uniform(rng, 2e-4, 6e-3), "hi": 0.03, "share": float(rng.uniform(0.15, 0.6))}

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        self.x = np.zeros((2, plant.n_runs))
        self.z = np.zeros((2, plant.n_runs))
        self.on = self.p.a > 0
        self.t1 = np.maximum(self.p.a / (1.0 + self.p.share), 1e-9)
        self.t2 = self.p.share * self.t1

    def spool(self, s: Any) -> tuple[np.ndarray, np.ndarray]:
        # Exact for a command held over the step; the difference of the two exponentials carries the second lag.
        e1, e2 = np.exp(-s.since / self.t1), np.exp(-s.since / self.t2)
        x = s.u + (self.x - s.u) * e1
        slope = self.t1 / (self.t1 - self.t2)
        z = s.u + (self.x - s.u) * slope * (e1 - e2) + (self.z - s.u) * e2
        return x, z

    def command(self, s: Any) -> None:
        s.x, s.z = self.spool(s)
        s.u = np.where(self.on, s.z, s.u)

    def commit(self, s: Any, h: np.ndarray) -> None:
        self.x, self.z = s.x, s.z


class TransportDelay(Ingredient):
    """The command takes effect late, by an odd number of samples and a fraction; the loop carries it out."""

    name, family = "transport_delay", "valve"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.004, "lo": log_uniform(rng, 4e-4, 8e-3), "hi": 0.02}


class SupplyDroop(Ingredient):
    """A tank that both valves draw from, filled by a regulator whose flow goes with a power of the missing pressure."""

    name, family = "supply_droop", "valve"
    rows = 1

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        full = n.C * n.rho0 * n.Ps
        return {
            "a": 5e4, "lo": 1.0, "hi": 3e5, "full": full, "tau": log_uniform(rng, 0.008, 0.12),
            "power": float(rng.uniform(0.85, 1.3)),
        }  # fmt: skip

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        y[self.at] = 0.0

    def supply(self, s: Any) -> None:
        s.Ps = s.Ps - s.y[self.at][0]

    def rates(self, s: Any) -> Any:
        p = self.p
        drawn = np.maximum(s.mdot, 0.0).sum(0)
        # Half the full flow takes the tank down by a / 2, whatever the power.
        missing = np.maximum(s.y[self.at], 0.0) / np.maximum(p.a, 1e-3)
        return p.a * (drawn / p.full - 0.5 * (2.0 * missing) ** p.power) / p.tau

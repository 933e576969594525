"""Causes that no library of the vocabulary holds: the right answer to them is "unknown"."""

from __future__ import annotations

from typing import Any

import numpy as np

from .excitation import DT
from .plant import Ingredient, Plant
from .quantities import Numbers


class _Clock(Ingredient):
    """Something that goes with time: its row is the time since the start, s."""

    family = "foreign"
    rows = 1

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        y[self.at] = 0.0

    def rates(self, s: Any) -> Any:
        return 1.0

    def wave(self, s: Any) -> Any:
        p = self.p
        return p.a * np.sin(p.omega * s.y[self.at][0] + p.phase + 2.4 * s.plant.order)


class SupplyPulsation(_Clock):
    """The compressor pulsates."""

    name = "supply_pulsation"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 2e4,
            "lo": 1.0,
            "hi": 1.5e5,
            "omega": float(rng.uniform(40, 110)),
            "phase": float(rng.uniform(0, 6)),
        }

    def supply(self, s: Any) -> None:
        s.Ps = s.Ps + self.wave(s)


class TorqueDisturbance(_Clock):
    """Something outside shakes the joint."""

    name = "torque_disturbance"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 0.05,
            "lo": 1e-6,
            "hi": 1.0,
            "omega": float(rng.uniform(12, 60)),
            "phase": float(rng.uniform(0, 6)),
        }

    def torque(self, s: Any) -> None:
        s.torque = s.torque + self.wave(s)


class ForceDrift(Ingredient):
    """The load cells drift with the room's temperature, each its own way, within and between runs."""

    name, family = "force_drift", "foreign"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        F = n.force(3e5, n.eps0)
        return {"a": 0.003 * F, "lo": 1e-7 * F, "hi": 0.05 * F, "omega": float(rng.uniform(0.8, 3.0))}

    def sense(self, m: Any, s: Any) -> None:
        if m.k >= 0:
            p, turn = self.p, 1.9 * s.plant.order
            m.F = m.F + p.a * np.stack([np.sin(p.omega * m.k * DT + turn), np.cos(0.7 * p.omega * m.k * DT - turn)])


class TensionRipple(Ingredient):
    """Threads that catch at regular places: tension that ripples with position."""

    name, family = "tension_ripple", "foreign"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        F = n.force(3e5, n.eps0)
        return {"a": 0.005 * F, "lo": 1e-7 * F, "hi": 0.05 * F, "pitch": n.r / n.L0 * float(rng.uniform(0.06, 0.2))}

    def force(self, s: Any) -> None:
        p = self.p
        s.F = s.F + p.a * np.sin(2 * np.pi * (s.eps - s.plant.eps0) / p.pitch)


class BeltElasticity(Ingredient):
    """A belt between pulley and joint that gives way; ``a`` is its compliance, rad/(N m)."""

    name, family = "belt_elasticity", "foreign"
    rows = 1

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 4e-3, "lo": 1e-7, "hi": 0.03, "tau": float(rng.uniform(0.002, 0.006))}

    def turn(self, s: Any) -> None:
        p, o = self.p, s.plant
        s.turn = s.q + s.y[self.at][0]
        eps = o.eps0 + o.gain * s.turn
        F = (s.P - o.Pa) * o.k * (3.0 * (o.L0 * (1 - eps)) ** 2 - o.b2)
        s.given = (p.a * o.r * (F[0] - F[1]) - s.y[self.at][0]) / p.tau
        s.turn_rate = s.w + s.given

    def rates(self, s: Any) -> Any:
        return s.given


class PressureCrosstalk(Ingredient):
    """Each pressure sensor reads a share of the other's."""

    name, family = "pressure_crosstalk", "foreign"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.02, "lo": 1e-6, "hi": 0.2, "sign": float(rng.choice([-1.0, 1.0]))}

    def sense(self, m: Any, s: Any) -> None:
        p = self.p
        m.P = m.P + p.sign * p.a * (m.P[::-1] - m.P)


class CrossLeak(Ingredient):
    """Air that seeps from the fuller muscle into the other one."""

    name, family = "cross_leak", "foreign"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        a = 0.01 * n.C * n.rho0
        return {"a": a, "lo": 1e-6 * a, "hi": 20 * a}

    def gas(self, s: Any) -> None:
        s.loss = s.loss + self.p.a * (s.P - s.P[::-1])


class EncoderRipple(Ingredient):
    """An encoder whose scale errs periodically."""

    name, family = "encoder_ripple", "foreign"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 1e-3, "lo": 1e-8, "hi": 6e-3, "lines": float(rng.uniform(18, 50))}

    def sense(self, m: Any, s: Any) -> None:
        m.q = m.q + self.p.a * np.sin(self.p.lines * m.q)


class FlowCurvature(Ingredient):
    """A flow meter whose curve bends."""

    name, family = "flow_curvature", "foreign"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.1, "lo": 1e-6, "hi": 0.6, "full": 0.3 * n.C * n.rho0 * n.Ps, "odd": float(rng.random() < 0.5)}

    def sense(self, m: Any, s: Any) -> None:
        p = self.p
        x = m.mdot / p.full
        m.mdot = m.mdot + p.a * p.full * np.where(p.odd > 0, x**3, x * x) / (1.0 + x * x)


class ValveRipple(Ingredient):
    """Ports of the valve that open in waves."""

    name, family = "valve_ripple", "foreign"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.005, "lo": 1e-7, "hi": 0.04, "waves": float(rng.uniform(20, 60))}

    def command(self, s: Any) -> None:
        s.u = s.u + self.p.a * np.sin(self.p.waves * s.u) * np.minimum(np.abs(s.u) * 20.0, 1.0)

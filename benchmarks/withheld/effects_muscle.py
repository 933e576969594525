"""What a muscle's tension has beyond the ideal braid: friction, hysteresis, elasticity, creep."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .plant import Ingredient, Plant
from .quantities import Numbers


def scale(n: Numbers) -> float:
    """Return a usual tension, N."""
    return n.force(3e5, n.eps0)


def stroke(n: Numbers) -> float:
    """Return a usual amplitude of the contraction."""
    return n.r / n.L0 * 0.3


class Bristle(Ingredient):
    """Dry friction with bristles: LuGre or a row of elastic-plastic asperities that share one yield strain.

    The bristles' deflection z, in units of the one at which they slide, follows ż = (ε̇ − |ε̇| z)/z₀ (LuGre), solved
    exactly over a step, or z ← clip(z + Δε/z₀, −1, 1) (Jenkins). The level rises with pressure.
    """

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        self.z = np.zeros((2, plant.n_runs))
        self.eps = np.repeat(plant.eps0[None], 2, 0)

    def bristles(self, s: Any) -> np.ndarray:
        p = self.p
        slid = np.where(s.deps >= 0, 1.0, -1.0)
        lugre = slid + (self.z - slid) * np.exp(-np.abs(s.eps - self.eps) / p.z0)
        jenkins = np.clip(self.z + (s.eps - self.eps) / p.z0, -1.0, 1.0)
        return np.where(p.lugre > 0, lugre, jenkins)

    def commit(self, s: Any, h: np.ndarray) -> None:
        self.z, self.eps = self.bristles(s), s.eps

    def level(self, s: Any) -> Any:
        p = self.p
        return p.a * (1.0 + p.mu * (s.gauge / 2e5 - 1.0))

    def force(self, s: Any) -> None:
        s.F = s.F - self.level(s) * self.bristles(s)


class CoulombFriction(Bristle):
    name, family = "coulomb_friction", "friction"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 0.01 * scale(n), "lo": 1e-6 * scale(n), "hi": 0.06 * scale(n), "lugre": float(rng.random() < 0.6),
            "z0": float(np.exp(rng.uniform(math.log(6e-5), math.log(5e-4)))), "mu": float(rng.uniform(0.0, 0.45)),
        }  # fmt: skip


class StribeckFriction(Bristle):
    """LuGre whose sliding level falls from its static one with a power of the speed that is not two."""

    name, family = "stribeck_friction", "friction"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 0.008 * scale(n), "lo": 1e-6 * scale(n), "hi": 0.05 * scale(n), "lugre": 1.0, "mu": 0.0,
            "z0": float(np.exp(rng.uniform(math.log(6e-5), math.log(3e-4)))), "rise": float(rng.uniform(0.7, 2.2)),
            "vs": float(rng.uniform(0.08, 0.3)) * n.r / n.L0, "power": float(rng.uniform(0.7, 1.6)),
        }  # fmt: skip

    def level(self, s: Any) -> Any:
        p = self.p
        return p.a * (1.0 + p.rise * np.exp(-(np.abs(s.deps / p.vs) ** p.power)))


class ViscousFriction(Ingredient):
    """Damping with a power of the speed near one, that also grows with pressure."""

    name, family = "viscous_friction", "friction"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        a = 0.03 * scale(n) / (stroke(n) * 5)
        power = float(rng.uniform(0.88, 1.12)) if rng.random() < 0.5 else 1.0
        return {
            "a": a,
            "lo": 1e-5 * a,
            "hi": 6 * a,
            "power": power,
            "mu": float(rng.uniform(0, 0.3)),
            "v": stroke(n) * 5,
        }

    def force(self, s: Any) -> None:
        p = self.p
        x = s.deps / p.v
        drag = np.sign(x) * np.abs(x) ** p.power * p.v
        s.F = s.F - p.a * (1.0 + p.mu * (s.gauge / 2e5 - 1.0)) * drag


class Hysteresis(Ingredient):
    """Generalised Maxwell slip: eight elastic-plastic elements in parallel, their yield strains spread at random."""

    name, family = "hysteresis", "hysteresis"
    elements = 8

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        weights = rng.dirichlet(np.full(self.elements, 1.5))
        yields = stroke(n) * np.sort(np.exp(rng.uniform(math.log(0.02), math.log(0.9), self.elements)))
        shape = {f"w{j}": float(weights[j]) for j in range(self.elements)}
        shape |= {f"d{j}": float(yields[j]) for j in range(self.elements)}
        return {"a": 0.02 * scale(n), "lo": 1e-6 * scale(n), "hi": 0.12 * scale(n), **shape}

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        p = self.p
        self.w = np.stack([getattr(p, f"w{j}") for j in range(self.elements)])[:, None]
        self.d = np.stack([getattr(p, f"d{j}") for j in range(self.elements)])[:, None]
        self.x = np.zeros((self.elements, 2, plant.n_runs))
        self.eps = np.repeat(plant.eps0[None], 2, 0)

    def slips(self, s: Any) -> np.ndarray:
        return np.clip(self.x + (s.eps - self.eps), -self.d, self.d)

    def commit(self, s: Any, h: np.ndarray) -> None:
        self.x, self.eps = self.slips(s), s.eps

    def force(self, s: Any) -> None:
        s.F = s.F - self.p.a * (self.w / self.d * self.slips(s)).sum(0)


class BladderElasticity(Ingredient):
    """Mooney–Rivlin tube under axial stretch λ = 1 − ε: it pushes when the muscle is short."""

    name, family = "bladder_elasticity", "elasticity"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        a = 0.08 * scale(n)
        return {"a": a, "lo": 1e-6 * a, "hi": 8 * a, "ratio": float(rng.uniform(0.05, 0.8))}

    def force(self, s: Any) -> None:
        p, stretch = self.p, 1.0 - s.eps
        s.F = s.F + p.a * ((stretch - stretch**-2) + p.ratio * (1.0 - stretch**-3)) / (1.0 + p.ratio) / 3.0


class ThreadExtensibility(Ingredient):
    """Threads that stretch with their tension, which goes with pressure and diameter; the volume grows with them."""

    name, family = "thread_extensibility", "elasticity"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.004, "lo": 1e-7, "hi": 0.03, "power": float(rng.uniform(0.85, 1.0))}

    def shape(self, s: Any) -> None:
        p, o = self.p, s.plant
        x = np.maximum(s.gauge, 1.0) / 2e5
        grown = 1.0 + p.a * x**p.power
        rate = p.a * p.power * x ** (p.power - 1.0) / 2e5
        more = o.b2 * (grown**2 - 1.0)
        s.V = s.V + o.k * more * s.L
        s.V_eps = s.V_eps - o.L0 * o.k * more
        s.V_P = s.V_P + o.k * s.L * 2.0 * o.b2 * grown * rate


class EndCap(Ingredient):
    """The ends stay as wide as at rest: cones instead of a cylinder, their missing volume taken from V."""

    name, family = "end_cap", "elasticity"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.5, "lo": 1e-4, "hi": 3.0}

    def shape(self, s: Any) -> None:
        p, o = self.p, s.plant
        # Two cones of length a D/2 in place of cylinders: V misses a π/12 D (2 D² − D D₀ − D₀²).
        D2 = np.maximum(4.0 / np.pi * o.k * (o.b2 - s.L**2), 1e-12)
        D = np.sqrt(D2)
        D_eps = 4.0 / np.pi * o.k * o.L0 * s.L / D
        s.V = s.V - p.a * np.pi / 12.0 * D * (2 * D2 - D * o.D0 - o.D0**2)
        s.V_eps = s.V_eps - p.a * np.pi / 12.0 * (6 * D2 - 2 * D * o.D0 - o.D0**2) * D_eps


class Creep(Ingredient):
    """Three Maxwell arms whose relaxation follows a power law of time over two decades."""

    name, family = "creep", "viscoelasticity"
    rows = 6

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        a = 0.08 * scale(n) / stroke(n)
        tau, order = float(np.exp(rng.uniform(math.log(0.15), math.log(0.6)))), float(rng.uniform(0.1, 0.6))
        ratio = float(rng.uniform(3.0, 5.0))
        return {"a": a, "lo": 1e-6 * a, "hi": 4 * a, "tau": tau, "order": order, "ratio": ratio}

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        p = self.p
        arms = np.arange(3)[:, None]
        self.tau = np.repeat(p.tau * p.ratio**arms, 2, 0)
        weight = p.ratio ** (-p.order * arms)
        self.weight = np.repeat(weight / weight.sum(0), 2, 0)
        y[self.at] = plant.eps0

    def rates(self, s: Any) -> Any:
        return (np.tile(s.eps, (3, 1)) - s.y[self.at]) / self.tau

    def force(self, s: Any) -> None:
        pull = (self.weight * (np.tile(s.eps, (3, 1)) - s.y[self.at])).reshape(3, 2, -1).sum(0)
        s.F = s.F - self.p.a * pull

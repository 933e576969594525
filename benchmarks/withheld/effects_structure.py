"""Numbers beyond their tolerance, and loads on the joint."""

from __future__ import annotations

from typing import Any

import numpy as np

from .plant import Ingredient
from .quantities import TOLERANCE, Numbers


class _Beyond(Ingredient):
    """A number that is off its nominal value by its tolerance and ``a`` more."""

    key = ""
    usual = 0.05
    most = 0.3

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": self.usual, "lo": 1e-6, "hi": self.most, "sign": float(rng.choice([-1.0, 1.0]))}

    def numbers(self, n: Numbers, p: dict[str, float]) -> Numbers:
        """Return ``n``, whose number is nominal here, with it beyond its tolerance."""
        return n.changed(**{self.key: p["sign"] * (TOLERANCE.get(self.key, 0.0) + p["a"])})


class Length(_Beyond):
    name, family, key, usual, most = "length", "geometry", "L0", 0.01, 0.06


class Diameter(_Beyond):
    name, family, key, usual, most = "diameter", "geometry", "D0", 0.02, 0.15


class BraidAngle(_Beyond):
    name, family, key, usual, most = "braid_angle", "geometry", "theta", 0.02, 0.12


class ValveConductance(_Beyond):
    name, family, key, usual, most = "valve_conductance", "valve", "C", 0.1, 0.4


class Inertia(_Beyond):
    name, family, key, usual, most = "inertia", "load", "J", 0.1, 0.5


class JointDamping(_Beyond):
    """Damping beyond its tolerance, its growth with speed a little less than linear."""

    name, family, key, usual, most = "joint_damping", "load", "bq", 0.4, 4.0

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        shape = super().draw(rng, n)
        return {**shape, "sign": 1.0 if rng.random() < 0.7 else -1.0, "hi": 4.0 if shape["sign"] > 0 else 0.8,
                "bend": float(rng.uniform(0.0, 0.15)), "bq": n.bq}  # fmt: skip

    def numbers(self, n: Numbers, p: dict[str, float]) -> Numbers:
        a = min(p["a"], 0.85) if p["sign"] < 0 else p["a"]
        return n.changed(bq=p["sign"] * (TOLERANCE["bq"] + a))

    def torque(self, s: Any) -> None:
        p = self.p
        s.torque = s.torque + p.bend * p.bq * np.minimum(p.a, 0.85) * p.sign * s.w * np.abs(s.w) / (1.0 + np.abs(s.w))


class Gravity(Ingredient):
    """An arm whose centre of mass hangs at an angle to the joint's zero."""

    name, family = "gravity", "load"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.3, "lo": 1e-7, "hi": 2.5, "phase": float(rng.choice([0.0, rng.uniform(-0.4, 0.4), np.pi / 2]))}

    def torque(self, s: Any) -> None:
        p = self.p
        s.torque = s.torque - p.a * np.sin(s.q + p.phase)

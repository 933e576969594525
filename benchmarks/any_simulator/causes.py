"""Causes of a gap at the ports of a system, in code of their own, and causes that no library holds.

Foreign are a sine in time at a joint, crosstalk between readings, a ripple of a reading that is no position, and a hum
of one that is: a ripple of a position is in the library.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .plants import Plant


class Cause:
    """Something that a system has and its simulator lacks.

    Parameters
    ----------
    name, port : str
        What it is, and where.
    p : dict of str to float
        Its numbers.
    foreign : bool
        Whether no library holds it.
    """

    def __init__(self, name: str, port: str, p: dict[str, float], foreign: bool = False) -> None:
        self.name, self.port, self.p, self.foreign = name, port, p, foreign
        self.memory: Any = None

    def begin(self, x: np.ndarray) -> None:
        self.memory = None


class Force(Cause):
    """A force at a joint or a flow into a chamber; it may remember a bristle."""

    def force(self, t: Any, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the force at time t, position (level) x and velocity v (level)."""
        p, n = self.p, self.name
        if n == "viscous_friction":
            scale = p["scale"]
            return -p["a"] * np.sign(v) * np.abs(v / scale) ** p["power"] * scale
        if n == "quadratic_drag":
            return -p["a"] * v * np.abs(v)
        if n in ("coulomb_friction", "stribeck_friction"):
            rise = p.get("rise", 0.0) * np.exp(-(np.abs(v / p.get("vs", 1.0)) ** p.get("sharp", 1.0)))
            return -p["a"] * (1.0 + rise) * self._bristle(x, v)
        if n == "leakage":
            return -p["a"] * np.maximum(x - 1.01e5, 0.0) / np.sqrt(1.0 + p["orifice"] * np.maximum(x - 1.01e5, 0) / 2e5)
        if n == "disturbance":
            return p["a"] * np.sin(p["omega"] * t + p["phase"]) + 0.0 * x
        raise KeyError(n)

    def begin(self, x: np.ndarray) -> None:
        self.memory = (np.zeros_like(x), x.copy())

    def _bristle(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        z, at = self.memory
        way = np.where(v >= 0, 1.0, -1.0)
        return way + (z - way) * np.exp(-np.abs(x - at) / self.p["z0"])

    def commit(self, x: np.ndarray, v: np.ndarray) -> None:
        if "friction" in self.name and "z0" in self.p:
            self.memory = (self._bristle(x, v), x.copy())


class Command(Cause):
    """A fault on the way from a command to what the system gets; called every step of h seconds."""

    def drive(self, c: np.ndarray, h: float) -> np.ndarray:
        p, n = self.p, self.name
        if n == "actuator_gain":
            return c * (1.0 + p["a"])
        if n == "actuator_bias":
            return c + p["a"]
        if n == "actuator_dead_zone":
            return np.sign(c) * np.maximum(np.abs(c) - p["a"], 0.0)
        if n == "actuator_saturation":
            return np.clip(c, -p["limit"], p["limit"])
        if n == "actuator_lag":
            if self.memory is None:
                self.memory = c.copy()
            self.memory = c + (self.memory - c) * np.exp(-h / p["a"])
            return self.memory
        if n == "actuator_delay":
            kept = self.memory or []
            kept.append(c.copy())
            steps = max(1, round(p["a"] / h))
            self.memory = kept[-steps - 1 :]
            return self.memory[0]
        if n == "actuator_backlash":
            if self.memory is None:
                self.memory = c.copy()
            self.memory = np.clip(self.memory, c - p["a"], c + p["a"])
            return self.memory
        raise KeyError(n)


class Reading(Cause):
    """A fault of a sensor, on whole runs, shape (n_samples, n_runs)."""

    def read(self, y: np.ndarray, dt: float, others: dict[str, np.ndarray]) -> np.ndarray:
        p, n = self.p, self.name
        if n == "sensor_gain":
            return y * (1.0 + p["a"])
        if n == "sensor_bias":
            return y + p["a"]
        if n == "sensor_saturation":
            return np.minimum(y, p["limit"])
        if n == "sensor_lag":
            out, keep = y.copy(), np.exp(-dt / p["a"])
            gone = 1.0 - (1.0 - keep) * p["a"] / dt  # a straight line between samples, exactly
            for k in range(1, len(y)):
                out[k] = keep * out[k - 1] + (1.0 - keep) * y[k - 1] + gone * (y[k] - y[k - 1])
            return out
        if n == "sensor_delay":
            t = np.arange(len(y)) * dt
            return np.stack([np.interp(t - p["a"], t, col) for col in y.T], axis=1)
        if n == "ripple":
            return y + p["a"] * np.sin(2 * np.pi * y / p["pitch"] + p["phase"])
        if n == "hum":
            t = np.arange(len(y)) * dt
            return y + p["a"] * np.sin(p["omega"] * t + p["phase"])[:, None]
        if n == "crosstalk":
            other = others[sorted(k for k in others if k != self.port)[0]]
            return y + p["a"] * (other - np.mean(other)) * np.std(y) / (np.std(other) or 1.0)
        raise KeyError(n)


class Number(Cause):
    """A parameter that is off by more than its tolerance."""


JOINT = ("viscous_friction", "coulomb_friction", "stribeck_friction", "quadratic_drag")
INPUT = ("actuator_gain", "actuator_dead_zone", "actuator_lag", "actuator_delay", "actuator_saturation")
OUTPUT = ("sensor_gain", "sensor_lag", "sensor_delay", "sensor_bias")
FOREIGN = ("disturbance", "ripple", "crosstalk", "hum")
POSITIONS = ("hinge_q", "x", "angle", "s")
"""Readings whose ripple is in the library."""


def menu(plant: Plant) -> list[tuple[str, str]]:
    """Return what a system can have: names and ports."""
    found = []
    for place in plant.forces:
        found += [(n, place) for n in (("leakage",) if place.startswith("chamber") else JOINT)]
    found += [(n, i) for i in plant.inputs for n in INPUT if plant.name != "tanks" or n != "actuator_dead_zone"]
    found += [(n, r) for r in plant.readings for n in OUTPUT]
    return found + [("parameter_deviation", p) for p in plant.numbers]


def foreign_menu(plant: Plant) -> list[tuple[str, str]]:
    """Return what it can have that no library holds."""
    joints = [j for j in plant.forces if not j.startswith("chamber")]
    found = [("disturbance", j) for j in joints]
    found += [("hum" if r in POSITIONS else "ripple", r) for r in plant.readings]
    return found + ([("crosstalk", r) for r in plant.readings] if len(plant.readings) > 1 else [])


def drawn(name: str, port: str, plant: Plant, sizes: dict[str, tuple[float, float]], rng: np.random.Generator) -> Cause:
    """Return a cause with numbers drawn; `sizes` are deviation and range of each signal of a log without causes."""
    share = float(np.exp(rng.uniform(np.log(0.03), np.log(0.3))))
    way = float(rng.choice([-1.0, 1.0]))
    if port in plant.forces:
        x, v = plant.forces[port]
        F, speed, span = plant.sizes[port] * share, sizes[plant.states[v]][0], sizes[plant.states[x]][1]
        numbers: dict[str, float] = {
            "viscous_friction": {"a": F / speed, "scale": speed, "power": float(rng.uniform(0.95, 1.05))},
            "quadratic_drag": {"a": F / speed**2},
            "coulomb_friction": {"a": F, "z0": span * 5e-4},
            "stribeck_friction": {
                "a": 0.5 * F, "z0": span * 5e-4, "rise": float(rng.uniform(0.8, 2.0)), "vs": 0.3 * speed,
                "sharp": float(rng.uniform(0.9, 1.8)),
            },
            "leakage": {"a": F / 2.5e5, "orifice": float(rng.uniform(0.0, 1.0))},
            "disturbance": {"a": F, "omega": float(rng.uniform(9.0, 25.0)), "phase": float(rng.uniform(0, 6))},
        }[name]  # fmt: skip
        return Force(name, port, numbers, name in FOREIGN)
    if port in plant.inputs:
        deviation, span = sizes[port]
        tau = plant.dt * float(np.exp(rng.uniform(np.log(1.0), np.log(6.0))))
        numbers = {
            "actuator_gain": {"a": way * share}, "actuator_bias": {"a": way * share * deviation},
            "actuator_dead_zone": {"a": share * deviation}, "actuator_lag": {"a": tau}, "actuator_delay": {"a": tau},
            "actuator_saturation": {"limit": 0.5 * span * float(rng.uniform(0.35, 0.8))},
            "actuator_backlash": {"a": 0.5 * share * deviation},
        }[name]  # fmt: skip
        if name == "actuator_saturation" and plant.name == "tanks":
            numbers = {"limit": float(rng.uniform(2.4, 3.3))}
        return Command(name, port, numbers, name in FOREIGN)
    if name == "parameter_deviation":
        return Number(name, port, {"a": way * float(rng.uniform(0.15, 0.35))})
    deviation, span = sizes[port]
    tau = plant.dt * float(np.exp(rng.uniform(np.log(0.5), np.log(4.0))))
    pitch = span * float(rng.uniform(0.04, 0.12))
    numbers = {
        "sensor_gain": {"a": way * 0.5 * share}, "sensor_bias": {"a": way * share * deviation},
        "sensor_lag": {"a": tau}, "sensor_delay": {"a": tau},
        "ripple": {"a": 0.03 * share * span, "pitch": pitch, "phase": float(rng.uniform(0, 6))},
        "crosstalk": {"a": 0.3 * share},
        # Ten to thirty samples a period, from a draw that is there: other cases stay as they are.
        "hum": {"a": 0.03 * share * span, "omega": 2 * np.pi / (250.0 * pitch / span * plant.dt), "phase": 0.0},
    }[name]  # fmt: skip
    return Reading(name, port, numbers, name in FOREIGN)

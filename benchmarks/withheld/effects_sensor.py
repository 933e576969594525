"""Faults of the sensors, the same for both muscles; the controller reads them too."""

from __future__ import annotations

from typing import Any

import numpy as np

from .excitation import DT
from .plant import Ingredient, Plant
from .quantities import Numbers


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


class PressureBias(Ingredient):
    name, family = "pressure_bias", "sensor"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 1000.0, "lo": 0.01, "hi": 12_000.0, "sign": _sign(rng)}

    def sense(self, m: Any, s: Any) -> None:
        m.P = m.P + self.p.sign * self.p.a


class PressureGain(Ingredient):
    """Wrong gain on absolute or on gauge pressure, as the sensor was calibrated."""

    name, family = "pressure_gain", "sensor"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.01, "lo": 1e-7, "hi": 0.08, "sign": _sign(rng), "gauge": float(rng.random() < 0.4)}

    def sense(self, m: Any, s: Any) -> None:
        p = self.p
        m.P = m.P + p.sign * p.a * (m.P - p.gauge * s.plant.Pa)


class _Lag(Ingredient):
    """A sensor of second order: two lags in a row, the second much the shorter."""

    family = "sensor"
    rows = 4
    channel = ""

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        lo = float(np.exp(rng.uniform(np.log(4e-4), np.log(6e-3))))
        return {"a": max(0.003, lo), "lo": lo, "hi": 0.04, "share": float(rng.uniform(0.05, 0.35))}

    def true(self, s: Any) -> np.ndarray:
        return getattr(s, self.channel)

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        p = self.p
        self.on = p.a > 0
        self.t1 = np.where(self.on, np.maximum(p.a / (1.0 + p.share), 3e-4), 1.0)
        self.t2 = np.where(self.on, np.maximum(p.share * self.t1, 3e-4), 1.0)

    def settle(self, y: np.ndarray, plant: Plant) -> None:
        rest = plant.stage(y, np.zeros((2, plant.n_runs)), 0.0, full=False)
        y[self.at] = np.tile(self.true(rest), (2, 1))

    def rates(self, s: Any) -> Any:
        x = s.y[self.at]
        return np.concatenate([(self.true(s) - x[:2]) / self.t1, (x[:2] - x[2:]) / self.t2])

    def sense(self, m: Any, s: Any) -> None:
        setattr(m, self.channel, np.where(self.on, s.y[self.at][2:], getattr(m, self.channel)))


class PressureLag(_Lag):
    name, channel = "pressure_lag", "P"


class ForceLag(_Lag):
    name, channel = "force_lag", "F"


class FlowLag(_Lag):
    name, channel = "flow_lag", "mdot"


class ForceBias(Ingredient):
    name, family = "force_bias", "sensor"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        F = n.force(3e5, n.eps0)
        return {"a": 0.01 * F, "lo": 1e-7 * F, "hi": 0.06 * F, "sign": _sign(rng)}

    def sense(self, m: Any, s: Any) -> None:
        m.F = m.F + self.p.sign * self.p.a


class ForceGain(Ingredient):
    """Wrong gain, with a little curvature."""

    name, family = "force_gain", "sensor"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {
            "a": 0.02, "lo": 1e-6, "hi": 0.15, "sign": _sign(rng), "bend": float(rng.uniform(-0.1, 0.1)),
            "F": n.force(3e5, n.eps0),
        }  # fmt: skip

    def sense(self, m: Any, s: Any) -> None:
        p = self.p
        m.F = m.F * (1.0 + p.sign * p.a * (1.0 + p.bend * (m.F / p.F - 1.0)))


class FlowBias(Ingredient):
    name, family = "flow_bias", "sensor"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        full = n.C * n.rho0 * n.Ps
        return {"a": 0.003 * full, "lo": 1e-8 * full, "hi": 0.03 * full, "sign": _sign(rng)}

    def sense(self, m: Any, s: Any) -> None:
        m.mdot = m.mdot + self.p.sign * self.p.a


class AngleGain(Ingredient):
    """Wrong gain of the encoder's gear, with a small eccentricity."""

    name, family = "angle_gain", "sensor"

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.02, "lo": 1e-6, "hi": 0.12, "sign": _sign(rng), "eccentric": float(rng.uniform(0.0, 0.04))}

    def sense(self, m: Any, s: Any) -> None:
        p = self.p
        m.q = m.q + p.sign * p.a * (m.q + p.eccentric * np.sin(2.0 * m.q))


class AngleDelay(Ingredient):
    """The encoder's reading arrives late by a number of samples that is not whole; between samples it is a cubic."""

    name, family = "angle_delay", "sensor"
    _kept = 32

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        return {"a": 0.004, "lo": 1e-5, "hi": 0.025}

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        self.whole = np.floor(self.p.a / DT).astype(int)
        self.part = self.p.a / DT - self.whole
        self.past = np.zeros((self._kept, 2, plant.n_runs))
        self.columns = np.arange(plant.n_runs)
        self.last = -1

    def sense(self, m: Any, s: Any) -> None:
        if m.k < 0:
            return
        if m.k != self.last:
            self.past = np.roll(self.past, 1, 0)
            self.past[0] = np.stack([s.q, s.w])
            self.last = m.k
        new, old = self.past[self.whole, :, self.columns].T, self.past[self.whole + 1, :, self.columns].T
        t = 1.0 - self.part  # from the older sample to the newer one
        h00, h10 = (1 + 2 * t) * (1 - t) ** 2, t * (1 - t) ** 2
        h01, h11 = t * t * (3 - 2 * t), t * t * (t - 1)
        late = h00 * old[0] + h10 * DT * old[1] + h01 * new[0] + h11 * DT * new[1]
        m.q = np.where(self.p.a > 0, m.q + (late - s.q), m.q)

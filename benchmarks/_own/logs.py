"""Logs of the systems by integrators of their own: Euler's, Runge-Kutta's, adaptive; inputs held or linear; sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from .systems import System

INTEGRATORS = ("euler", "runge-kutta", "adaptive", "semi-implicit")


@dataclass(frozen=True)
class Recording:
    """How a log is made.

    Parameters
    ----------
    dt : float
        Sampling interval, s.
    samples, runs : int
        Rows of a run, and how many.
    integrator : str
        One of `INTEGRATORS`.
    linear : bool
        Whether inputs go straight from sample to sample; else they are held.
    noise : float
        Factor on the usual noise.
    step : float
        Resolution of the readings as a share of their range; 0 for none.
    steps : int, default=0
        Steps of Euler's methods a sample; 0 for as many as follow the system closely.
    memory : float, default=0.0
        Samples over which the noise of readings falls to 1/e; 0 for white noise.
    """

    dt: float
    samples: int
    runs: int
    integrator: str
    linear: bool
    noise: float
    step: float
    steps: int = 0
    memory: float = 0.0

    @property
    def noisy(self) -> str:
        """The noise, in words."""
        lasts = f" that lasts {self.memory:.2g} samples" if self.memory else ""
        return f"noise x{self.noise:.2g}{lasts}"


def planned(system: System, how: Recording, rng: np.random.Generator) -> np.ndarray:
    """Return inputs or references, shape (samples, n, runs): sines, steps, or ramps between levels."""
    t, out = np.arange(how.samples) * how.dt, []
    for mean, amplitude, fastest in system.plan.values():
        runs = []
        for _ in range(how.runs):
            kind, top = rng.integers(3), 2.0 * np.pi * fastest / system.dt
            if kind == 0 or system.loop is not None:
                w = np.exp(rng.uniform(np.log(0.05 * top), np.log(top), 6))
                x = np.sin(w * t[:, None] + rng.uniform(0.0, 2.0 * np.pi, 6)).sum(axis=1) / 3.0
            else:
                hold = max(2, round(rng.uniform(0.5, 2.0) * np.pi / (top * how.dt)))
                levels = rng.uniform(-1.0, 1.0, how.samples // hold + 3)
                at = np.arange(how.samples) / hold
                x = levels[at.astype(int)] if kind == 1 else np.interp(at, np.arange(len(levels)), levels)
            runs.append(mean + amplitude * x)
        out.append(np.stack(runs, axis=1))
    return np.stack(out, axis=1)


def simulated(
    system: System, p: dict[str, float], how: Recording, rng: np.random.Generator,
    command: Callable[[np.ndarray, float], np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return states and logged inputs, shape (samples, n, runs); `command` is what becomes of inputs on their way.

    It gets the inputs of one sample, and the sampling interval, once a sample.
    """
    plan, numbers = planned(system, how, rng), SimpleNamespace(**p)
    n = len(system.states)
    x = system.start(rng, how.runs, p) if system.start else np.zeros((n, how.runs))
    inputs, states = list(system.inputs), list(system.states)

    def rate(t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        some = system.rates(
            t, SimpleNamespace(**dict(zip(states, x, strict=True))),
            SimpleNamespace(**dict(zip(inputs, u, strict=True))), numbers,
        )  # fmt: skip
        return np.stack([np.broadcast_to(row, x.shape[1:]) for row in some])

    xs, us, acting = [], [], None
    for k in range(how.samples):
        u = plan[k]
        if system.loop is not None:
            u = np.stack(system.loop(plan[k], SimpleNamespace(**dict(zip(states, x, strict=True))), numbers))
        xs.append(x)
        us.append(u)
        acting = u if command is None else command(u, how.dt)
        slope = np.zeros_like(u)
        if how.linear and system.loop is None and command is None and k + 1 < how.samples:
            slope = (plan[k + 1] - u) / how.dt
        x = advanced(lambda t, x, u=acting, s=slope: rate(t, x, u + s * t), x, how, system)
    return np.stack(xs), np.stack(us)


def advanced(rate: Callable[[float, np.ndarray], np.ndarray], x: np.ndarray, how: Recording, system: System) -> Any:
    """Return the states one sample later."""
    if how.integrator == "adaptive":
        from scipy.integrate import solve_ivp

        sizes = np.maximum(np.abs(x), 1e-3).ravel()
        found = solve_ivp(
            lambda t, y: rate(t, y.reshape(x.shape)).ravel(), (0.0, how.dt), x.ravel(), rtol=1e-7, atol=1e-8 * sizes
        )
        return found.y[:, -1].reshape(x.shape)
    if how.integrator in ("euler", "semi-implicit") and system.euler is not None:
        steps = how.steps or max(1, round(how.dt / system.euler))
        h, faster = how.dt / steps, speeds(rate, x) if how.integrator == "semi-implicit" else {}
        for j in range(steps):
            y = x + h * rate(j * h, x)
            for position, speed in faster.items():
                y[position] = x[position] + h * y[speed]
            x = y
        return x
    steps = max(2, round(how.dt / (system.finest * system.dt)))
    h = how.dt / steps
    for j in range(steps):
        t = j * h
        a = rate(t, x)
        b = rate(t + h / 2, x + h / 2 * a)
        c = rate(t + h / 2, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + rate(t + h, x + h * c))
    return x


def speeds(rate: Callable[[float, np.ndarray], np.ndarray], x: np.ndarray) -> dict[int, int]:
    """Return the rows of positions, each with that of its speed."""
    some = np.broadcast_to(1.0 + 0.1 * np.arange(len(x))[:, None], x.shape)
    return {i: k for i, row in enumerate(rate(0.0, some)) for k in range(len(x)) if np.array_equal(row, some[k])}


def log_of(
    system: System, x: np.ndarray, u: np.ndarray, how: Recording, rng: np.random.Generator,
    readings: list[str] | None = None, read: Callable[[str, np.ndarray], np.ndarray] | None = None,
) -> pd.DataFrame:  # fmt: skip
    """Return what was logged; `read` is what a sensor makes of its signal, shape (samples, runs)."""
    columns: dict[str, np.ndarray] = {}
    order = list(system.states)
    for k, name in enumerate(system.inputs):
        columns[name] = u[:, k]
    for name in system.readings if readings is None else readings:
        y = x[:, order.index(name)]
        y = y if read is None else read(name, y)
        spread = float(np.ptp(y)) or 1.0
        y = y + how.noise * system.readings.get(name, 3e-3) * spread * lasting(rng.standard_normal(y.shape), how.memory)
        if how.step:
            y = np.round(y / (how.step * spread)) * (how.step * spread)
        columns[name] = y
    t = np.arange(how.samples) * how.dt
    runs = [
        pd.DataFrame({"trajectory": f"run {r + 1}", "time": t, **{n: c[:, r] for n, c in columns.items()}})
        for r in range(how.runs)
    ]
    return pd.concat(runs, ignore_index=True)


def lasting(white: np.ndarray, memory: float) -> np.ndarray:
    """Return noise that lasts, of unit deviation, from white noise of shape (samples, runs)."""
    if not memory:
        return white
    rho, out = float(np.exp(-1.0 / memory)), white.copy()
    for k in range(1, len(out)):
        out[k] = rho * out[k - 1] + np.sqrt(1.0 - rho**2) * white[k]
    return out

"""Systems beside those of `benchmarks/any_simulator`: a cart on a spring, a pole, a drive with its load."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from benchmarks.any_simulator.plants import Plant, multisine


class Rail(Plant):
    """A cart on a rail, between spring and damper; position and speed are logged."""

    name = "rail"
    states, inputs = ("x", "v"), ("force",)
    forces: ClassVar = {"rail": (0, 1)}
    sizes: ClassVar = {"rail": 6.0}
    readings: ClassVar = {"x": (0, 2e-5), "v": (1, 1e-3)}

    def __init__(self) -> None:
        super().__init__({"m": (2.0, 0.02), "b": (3.0, 0.05), "k": (15.0, 0.02)})

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        """Return forces, N."""
        return 8.0 * multisine(rng, runs, 1.0, 9.0, self.samples + 1, self.dt)

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        """Return the force."""
        return np.asarray(plan[k])[None]

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        """Return speed and acceleration."""
        return np.stack([x[1], (u[0] + f[0] - p["b"] * x[1] - p["k"] * x[0]) / p["m"]])


class Pole(Plant):
    """A motor's speed behind its voltage, one pole; the speed is logged."""

    name = "pole"
    states, inputs = ("speed",), ("volt",)
    readings: ClassVar = {"speed": (0, 0.02)}
    stretch = 400

    def __init__(self) -> None:
        super().__init__({"K": (2.5, 0.0), "T": (0.3, 0.0)})

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        """Return voltages: levels, each held for a while."""
        hold, levels = rng.integers(15, 60, runs), rng.uniform(-5.0, 5.0, (self.samples, runs))
        return levels[np.arange(self.samples + 1)[:, None] // hold[None], np.arange(runs)[None]]

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        """Return the voltage."""
        return np.asarray(plan[k])[None]

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        """Return the angular acceleration."""
        return np.stack([(p["K"] * u[0] - x[0]) / p["T"]])


class Drive(Plant):
    """Motor and load on a soft shaft, with a play of ``play`` rad between them; both angles and speeds are logged."""

    name = "drive"
    dt, substeps, samples = 0.002, 4, 800
    states, inputs = ("qm", "ql", "wm", "wl"), ("current",)
    forces: ClassVar = {"motor": (0, 2), "load": (1, 3)}
    sizes: ClassVar = {"motor": 0.4, "load": 0.4}
    readings: ClassVar = {"qm": (0, 2e-5), "ql": (1, 2e-5), "wm": (2, 0.01), "wl": (3, 0.01)}

    def __init__(self) -> None:
        super().__init__({"Jm": (2e-3, 0.02), "Jl": (8e-3, 0.02), "K": (40.0, 0.05), "D": (0.08, 0.1),
                          "kt": (0.5, 0.01), "play": (0.0, 0.0)})  # fmt: skip

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        """Return currents, A."""
        return 1.5 * multisine(rng, runs, 3.0, 40.0, self.samples + 1, self.dt)

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        """Return the current, which also holds the drive about its middle."""
        return (plan[k] - 1.5 * x[0] - 0.05 * x[2])[None]

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        """Return speeds and accelerations."""
        apart = x[0] - x[1]
        wound = np.sign(apart) * np.maximum(np.abs(apart) - p["play"], 0.0)
        shaft = p["K"] * wound + p["D"] * (x[2] - x[3]) * (np.abs(apart) >= p["play"])
        motor = (p["kt"] * u[0] - shaft - 0.01 * x[2] + f[0]) / p["Jm"]
        return np.stack([x[2], x[3], motor, (shaft - 0.02 * x[3] + f[1]) / p["Jl"]])


RAIL = {"dx/dt": "v", "dv/dt": "(force - b*v - k*x)/m"}
DRIVE = {
    "dqm/dt": "wm", "dql/dt": "wl",
    "dwm/dt": "(kt*current - K*(qm - ql) - D*(wm - wl) - 0.01*wm)/Jm",
    "dwl/dt": "(K*(qm - ql) + D*(wm - wl) - 0.02*wl)/Jl",
}  # fmt: skip
"""Rates as text, and as bodies of functions."""

"""Four systems in code of their own: a servo, a cart with a pendulum, a pneumatic cylinder, two tanks.

Arrays are vectors over runs: states (n_states, n), inputs (n_inputs, n), forces (n_forces, n).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np


@dataclass
class Plant:
    """A system.

    Parameters
    ----------
    numbers : dict of str to (float, float)
        Its parameters: nominal value, relative tolerance.
    """

    numbers: dict[str, tuple[float, float]] = field(default_factory=dict)
    name: ClassVar[str] = ""
    dt: ClassVar[float] = 0.01
    substeps: ClassVar[int] = 5
    samples: ClassVar[int] = 400
    states: ClassVar[tuple[str, ...]] = ()
    inputs: ClassVar[tuple[str, ...]] = ()
    forces: ClassVar[dict[str, tuple[int, int]]] = {}
    """Joints and chambers in the order of the forces, with the rows of position and velocity (level twice)."""
    sizes: ClassVar[dict[str, float]] = {}
    """What counts as a large force at each of them."""
    readings: ClassVar[dict[str, tuple[int, float]]] = {}
    """Row of the state behind each sensor, and the standard deviation of its noise."""
    stretch: ClassVar[int] = 40
    """Samples over which a prediction from a known state can be trusted."""

    def value(self, p: dict[str, float]) -> dict[str, float]:
        """Return all parameters, some of them changed."""
        return {k: v for k, (v, _) in self.numbers.items()} | p

    def begin(self, rng: np.random.Generator, runs: int) -> np.ndarray:
        """Return where runs begin."""
        return np.zeros((len(self.states), runs))

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        """Return what the controller is told for whole runs."""
        raise NotImplementedError

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        """Return the inputs at sample k."""
        raise NotImplementedError

    def inside(self, x: np.ndarray) -> bool:
        """Return whether runs, shape (n_samples, n_states, n), stay where the system is what its rates say."""
        return bool(np.isfinite(x).all())

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        """Return the rates of the states."""
        raise NotImplementedError


def multisine(rng: np.random.Generator, runs: int, low: float, high: float, samples: int, dt: float) -> np.ndarray:
    """Return signals of five sines each, of unit deviation, shape (samples, runs)."""
    t = np.arange(samples)[:, None, None] * dt
    w = np.exp(rng.uniform(np.log(low), np.log(high), (1, runs, 5)))
    x = np.sum(np.sin(w * t + rng.uniform(0, 2 * np.pi, (1, runs, 5))), axis=2)
    return x / np.std(x, axis=0)


class Servo(Plant):
    """An arm of mass m at l on the shaft of a drive that a controller moves along references."""

    name = "servo"
    states, inputs = ("hinge_q", "hinge_dq"), ("motor",)
    forces: ClassVar = {"hinge": (0, 1)}
    sizes: ClassVar = {"hinge": 0.6}
    readings: ClassVar = {"hinge_q": (0, 2e-4), "hinge_dq": (1, 0.02)}

    def __init__(self) -> None:
        super().__init__({"m": (0.5, 0.05)})

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        wanted = 0.8 * multisine(rng, runs, 1.0, 7.0, self.samples + 1, self.dt)
        return wanted, np.gradient(wanted, self.dt, axis=0)

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        r, dr = plan
        return np.clip(4.0 * (r[k] - x[0]) + 0.25 * (dr[k] - x[1]), -3.0, 3.0)[None]

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        m = p["m"]
        inertia = m * (0.15**2 + 0.05**2) + 0.002
        return np.stack([x[1], (u[0] + f[0] - m * 9.81 * 0.15 * np.sin(x[0])) / inertia])


class CartPole(Plant):
    """A cart with a pendulum that swings wide, both angles and positions from encoders."""

    name = "cart"
    states, inputs = ("x", "angle", "v", "omega"), ("force",)
    forces: ClassVar = {"rail": (0, 2), "hinge": (1, 3)}
    sizes: ClassVar = {"rail": 4.0, "hinge": 0.15}
    readings: ClassVar = {"x": (0, 5e-5), "angle": (1, 3e-4)}
    stretch = 30

    def __init__(self) -> None:
        super().__init__({"cart": (1.2, 0.05), "bob": (0.3, 0.05)})

    def begin(self, rng: np.random.Generator, runs: int) -> np.ndarray:
        return np.stack([np.zeros(runs), rng.uniform(-2.5, 2.5, runs), np.zeros(runs), np.zeros(runs)])

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        return 6.0 * multisine(rng, runs, 2.0, 9.0, self.samples + 1, self.dt)

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        return (plan[k] - 4.0 * x[0] - 1.0 * x[2])[None]

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        cart, bob, long, own = p["cart"], p["bob"], 0.3, 0.004
        s, c = np.sin(x[1]), np.cos(x[1])
        a, b, d = cart + bob, bob * long * c, own + bob * long**2
        pushed = u[0] + f[0] + bob * long * x[3] ** 2 * s
        turned = f[1] - bob * 9.81 * long * s
        det = a * d - b * b
        return np.stack([x[2], x[3], (d * pushed - b * turned) / det, (a * turned - b * pushed) / det])


class Cylinder(Plant):
    """A double-acting cylinder with a proportional valve; both pressures and the position are logged."""

    name = "cylinder"
    dt = 0.005
    states, inputs = ("s", "v", "p1", "p2"), ("valve",)
    forces: ClassVar = {"rod": (0, 1), "chamber1": (2, 2), "chamber2": (3, 3)}
    sizes: ClassVar = {"rod": 60.0, "chamber1": 3e-4, "chamber2": 3e-4}
    readings: ClassVar = {"s": (0, 1e-5), "p1": (2, 300.0), "p2": (3, 300.0)}

    def __init__(self) -> None:
        super().__init__({"m": (2.0, 0.05), "C": (3e-9, 0.05)})

    def begin(self, rng: np.random.Generator, runs: int) -> np.ndarray:
        return np.stack([rng.uniform(-0.03, 0.03, runs), np.zeros(runs), np.full(runs, 3.5e5), np.full(runs, 3.5e5)])

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        return 0.04 * multisine(rng, runs, 1.5, 10.0, self.samples + 1, self.dt)

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        return np.clip(20.0 * (plan[k] - x[0]), -1.0, 1.0)[None]

    def inside(self, x: np.ndarray) -> bool:
        """Return whether the piston stays off its ends, beyond which a chamber has no volume."""
        return super().inside(x) and bool(np.max(np.abs(x[:, 0])) < 0.11)

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        area, gamma, RT, top, room = (8.0e-4, 7.0e-4), 1.4, 287.0 * 293.0, 7e5, 1.01e5

        def flow(opened: Any, pressure: Any) -> Any:
            up, down = np.where(opened > 0, top, pressure), np.where(opened > 0, pressure, room)
            ratio = np.clip((down / up - 0.3) / 0.7, 0.0, 1.0)
            return p["C"] * opened * up * np.sqrt(1.0 - ratio**2 + 1e-4)

        V1, V2 = area[0] * (0.12 + x[0]), area[1] * (0.12 - x[0])
        dp1 = gamma / V1 * (RT * (flow(u[0], x[2]) + f[1]) - x[2] * area[0] * x[1])
        dp2 = gamma / V2 * (RT * (flow(-u[0], x[3]) + f[2]) + x[3] * area[1] * x[1])
        push = (x[2] - room) * area[0] - (x[3] - room) * area[1] - 60.0 * x[1]
        return np.stack([x[1], (push + f[0]) / p["m"], dp1, dp2])


class Tanks(Plant):
    """Two tanks one above the other; a pump fills the upper one, a sensor reads the lower one."""

    name = "tanks"
    dt, substeps, samples = 2.0, 4, 250
    states, inputs = ("h1", "h2"), ("pump",)
    readings: ClassVar = {"level": (1, 0.01)}
    stretch = 250

    def __init__(self) -> None:
        super().__init__({"k1": (0.06, 0.05), "k2": (0.05, 0.05), "k3": (0.05, 0.05)})

    def begin(self, rng: np.random.Generator, runs: int) -> np.ndarray:
        return rng.uniform(2.0, 5.0, (2, runs))

    def plan(self, rng: np.random.Generator, runs: int) -> Any:
        hold = rng.integers(15, 50, runs)
        steps = rng.uniform(1.2, 3.6, (self.samples // 10, runs))
        rows = np.arange(self.samples + 1)[:, None] // hold[None]
        return steps[rows, np.arange(runs)[None]]

    def command(self, plan: Any, k: int, x: np.ndarray) -> np.ndarray:
        return plan[k][None]

    def rates(self, x: np.ndarray, u: np.ndarray, f: np.ndarray, p: dict[str, float]) -> np.ndarray:
        one, two = np.sqrt(np.maximum(x[0], 0.0)), np.sqrt(np.maximum(x[1], 0.0))
        return np.stack([p["k1"] * u[0] - p["k2"] * one, p["k2"] * one - p["k3"] * two])


PLANTS: dict[str, type[Plant]] = {c.name: c for c in (Servo, CartPole, Cylinder, Tanks)}  # type: ignore[dict-item]

"""Equations of the bench for many runs at once, with hooks for what the nominal simulator leaves out.

Arrays carry runs along their last axis and the two muscles along the one before. The state of a run is angle, speed and
both pressures; effects append rows of their own. Steps are taken by Kutta's 3/8 rule, two a millisecond, and may be
split elsewhere than in the middle, so that a delayed command changes exactly between two steps.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from .excitation import DT
from .quantities import Numbers, braid

SIGN = np.array([[1.0], [-1.0]])
HOOKS = ("turn", "shape", "force", "supply", "command", "valve", "gas", "torque", "rates", "commit", "sense")
BASE = 4  # rows of the state that every bench has: q, w, P1, P2


class Ingredient:
    """Something that a bench has and its nominal simulator lacks.

    A subclass overrides `draw` and some of the hooks. In a batch, runs without it have amplitude 0, at which every hook
    must leave the bench exactly as it is.
    """

    name: ClassVar[str]
    """Its name in the key."""
    family: ClassVar[str]
    """Family in the vocabulary, or ``"foreign"``."""
    rows: ClassVar[int] = 0
    """Rows of its state."""

    def __init__(self) -> None:
        self.p: Any = SimpleNamespace()
        self.at = slice(0, 0)

    def draw(self, rng: np.random.Generator, n: Numbers) -> dict[str, float]:
        """Draw its shape; ``a``, ``lo``, ``hi`` are a usual amplitude and the bounds of what is plausible."""
        raise NotImplementedError

    def numbers(self, n: Numbers, p: dict[str, float]) -> Numbers:
        """Return the bench's numbers with it; most leave them alone."""
        return n

    def begin(self, y: np.ndarray, plant: Plant) -> None:
        """Set its rows of the state, and its memory, at rest."""

    def settle(self, y: np.ndarray, plant: Plant) -> None:
        """Set those rows that follow from the rest of the state, once every ingredient has begun."""

    def turn(self, s: Any) -> None:
        """Change ``s.turn`` and ``s.turn_rate``, angle and speed of the pulley."""

    def shape(self, s: Any) -> None:
        """Change ``s.V``, ``s.V_eps``, ``s.V_P``."""

    def force(self, s: Any) -> None:
        """Change ``s.F``."""

    def supply(self, s: Any) -> None:
        """Change ``s.Ps``."""

    def command(self, s: Any) -> None:
        """Change ``s.u``."""

    def valve(self, s: Any) -> None:
        """Change ``s.mdot``."""

    def gas(self, s: Any) -> None:
        """Change ``s.n`` (exponent), ``s.RT``, ``s.heat`` (W), ``s.loss`` (kg/s, past the flow meter)."""

    def torque(self, s: Any) -> None:
        """Change ``s.torque``."""

    def rates(self, s: Any) -> Any:
        """Return the time derivatives of its rows."""

    def commit(self, s: Any, h: np.ndarray) -> None:
        """Take over its memory at the end of a step of length ``h``; ``s`` is the stage there."""

    def sense(self, m: Any, s: Any) -> None:
        """Change what the sensors read: ``m.q``, ``m.P``, ``m.F``, ``m.mdot``, ``m.mdot_end``."""


def overrides(ingredient: Ingredient, hook: str) -> bool:
    """Whether an ingredient has a hook of its own."""
    return getattr(type(ingredient), hook) is not getattr(Ingredient, hook)


def flow_function(x: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return ψ of ISO 6358; zero against the pressure."""
    y = np.maximum((x - b) / (1.0 - b), 0.0)
    return np.sqrt(np.maximum(1.0 - y * y, 0.0))


class Plant:
    """All runs of a batch.

    Parameters
    ----------
    numbers : list of Numbers
        True numbers of each run.
    ingredients : list of Ingredient
        What is in any of the runs, its parameters set.
    order : list of int
        Place of each run in its log.
    """

    def __init__(self, numbers: list[Numbers], ingredients: list[Ingredient], order: list[int]) -> None:
        self.n_runs = len(numbers)
        self.order = np.array(order)
        for k in ("L0", "D0", "theta", "eps0", "C", "bc", "rho0", "r", "J", "bq", "gamma", "R", "T", "Pa", "Ps"):
            setattr(self, k, np.array([getattr(n, k) for n in numbers]))
        self.b2, self.k = (np.array(v) for v in zip(*[braid(n) for n in numbers], strict=True))
        self.RT0 = self.R * self.T
        self.gain = SIGN * self.r / self.L0
        self.ingredients = ingredients
        self.hooked = {h: [i for i in ingredients if overrides(i, h)] for h in HOOKS}
        rows = BASE
        for i in ingredients:
            i.at = slice(rows, rows + i.rows)
            rows += i.rows
        self.n_rows = rows

    def begin(self, P0: np.ndarray) -> np.ndarray:
        """Return the state at rest at angle 0 and pressure ``P0`` in both muscles."""
        y = np.zeros((self.n_rows, self.n_runs))
        y[2:4] = P0
        for i in self.ingredients:
            i.begin(y, self)
        for i in self.ingredients:
            i.settle(y, self)
        return y

    def stage(self, y: np.ndarray, u: np.ndarray, since: np.ndarray | float, full: bool = True) -> Any:
        """Evaluate the bench in a state, ``since`` seconds after the last committed one."""
        s = SimpleNamespace(plant=self, y=y, since=since)
        s.q, s.w, s.P = y[0], y[1], y[2:4]
        s.turn, s.turn_rate = s.q, s.w  # of the pulley; the joint's own angle where a belt lies between
        for i in self.hooked["turn"]:
            i.turn(s)
        s.eps = self.eps0 + self.gain * s.turn
        s.deps = self.gain * s.turn_rate
        L = self.L0 * (1.0 - s.eps)
        s.L, s.gauge = L, s.P - self.Pa
        s.V = self.k * (self.b2 * L - L**3)
        s.V_eps = -self.L0 * self.k * (self.b2 - 3.0 * L * L)
        s.V_P = 0.0
        for i in self.hooked["shape"]:
            i.shape(s)
        s.F = s.gauge * s.V_eps / self.L0
        for i in self.hooked["force"]:
            i.force(s)
        s.Ps = self.Ps
        for i in self.hooked["supply"]:
            i.supply(s)
        s.u = u
        for i in self.hooked["command"]:
            i.command(s)
        s.mdot = self.flow(s.u, s.P, s.Ps)
        for i in self.hooked["valve"]:
            i.valve(s)
        if not full:
            return s
        s.n, s.RT, s.heat, s.loss = self.gamma, self.RT0, 0.0, 0.0
        for i in self.hooked["gas"]:
            i.gas(s)
        s.torque = self.r * (s.F[0] - s.F[1]) - self.bq * s.w
        for i in self.hooked["torque"]:
            i.torque(s)
        rate = np.empty_like(y)
        rate[0], rate[1] = s.w, s.torque / self.J
        # First law with both flows at the supply's temperature: γ R T ṁ + (γ − 1) Q̇ = Ṗ V + γ P V̇.
        gained = s.n * s.RT * (s.mdot - s.loss) + (s.n - 1.0) * s.heat - s.n * s.P * s.V_eps * s.deps
        rate[2:4] = s.dP = gained / (s.V + s.n * s.P * s.V_P)
        for i in self.hooked["rates"]:
            rate[i.at] = i.rates(s)
        s.rate = rate
        return s

    def flow(self, u: np.ndarray, P: np.ndarray, Ps: np.ndarray) -> np.ndarray:
        """Mass flow through the valves, kg/s; into the muscle is positive."""
        full = self.C * self.rho0
        filling = Ps * flow_function(P / Ps, self.bc)
        venting = P * flow_function(self.Pa / P, self.bc)
        return full * u * np.where(u > 0, filling, venting)

    def step(self, y: np.ndarray, u: np.ndarray, h: np.ndarray, first: Any = None) -> tuple[np.ndarray, Any]:
        """Take one step of Kutta's 3/8 rule; return the new state and the stage there, its memory committed."""
        s1 = first if first is not None else self.stage(y, u, 0.0)
        k1 = s1.rate
        s2 = self.stage(y + h / 3 * k1, u, h / 3)
        k2 = s2.rate
        s3 = self.stage(y + h * (k2 - k1 / 3), u, 2 * h / 3)
        k3 = s3.rate
        k4 = self.stage(y + h * (k1 - k2 + k3), u, h).rate
        y = y + h / 8 * (k1 + 3 * k2 + 3 * k3 + k4)
        end = self.stage(y, u, h)
        for i in self.hooked["commit"]:
            i.commit(end, h)
        return y, end


def sample_interval_parts(fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two steps of a millisecond, split at a fraction of it."""
    return fraction * DT, (1.0 - fraction) * DT

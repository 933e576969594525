"""Laws that effects share, each on a signal of its own: bristles, plays, stops, relaxing branches, wrong numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from ..signals.paths import Path, play
from ..signals.state import Array
from ._memory import branches_along, branches_at, branches_relax, dahl, drawn_along
from ._stop import RATIOS, stopped, stops_along, stops_at
from .base import Effect, Signals
from .plant import Plant
from .values import Parameter

PRESLIDING = Parameter("presliding", "-", 1e-6, 2e-3, 2e-4, "displacement within which friction turns over", position=1)
TRANSITION = Parameter(
    "transition", "1/s", 0.0, 0.1, 0.0, "speed below which friction fades, as tanh", position=1, refines=True
)


class Bristles(Effect):
    """Dry friction that turns over within a displacement, by Dahl's bristles."""

    family = "friction"
    equations = ("force",)
    n_states = 1
    path_dependent = True
    presliding: float
    exponent: float = 1.0
    transition: float = 0.0

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return bristles at zero deflection."""
        return np.zeros((1, *np.shape(s.position)))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Bend the bristles by the displacement between the two instants."""
        return dahl(x, s1.position - s0.position, self.presliding, self.exponent)

    def trace_along(self, path: Path, plant: Plant, dt: float) -> Array:
        """Return the bristles along a path; where they bend exponentially, without a loop over its turns."""
        if self.exponent <= 0.999:
            return super().trace_along(path, plant, dt)
        turns = path.turns
        d = np.diff(turns.values, axis=0) / self.presliding
        at_turns = drawn_along(np.copysign(1.0, d), np.exp(-np.abs(d)), np.zeros(1, dtype=int))
        held = at_turns.ravel()[turns.last][None]
        return self.step(held, Signals(position=turns.before), Signals(position=path.position), dt, plant)

    def turned(self, s: Signals, x: Array) -> Array:
        """Return the direction of friction, from -1 to 1; it fades where a motion is slow."""
        return x[0] * np.tanh(np.abs(s.velocity) / self.transition) if self.transition else x[0]


class LostMotion(Effect):
    """What follows a signal once the play is used up."""

    of: ClassVar[str]
    """The role of the signal."""
    family = "hysteresis"
    source = "10.1016/S0005-1098(02)00047-X"
    n_states = 1
    sampled = True
    half_width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return the middle of the play."""
        return np.array(getattr(s, self.of), dtype=float)[None]

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Drag along where the play is used up."""
        now = getattr(s1, self.of)
        return np.clip(x, now - self.half_width, now + self.half_width)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the dragged position along each run, without a loop over time."""
        return play(np.asarray(getattr(s, self.of), dtype=float), self.half_width, starts)[None]


class Stops(Effect):
    """Elastic stops of three widths."""

    of: ClassVar[str]
    """The role of the signal that moves them."""
    family = "hysteresis"
    n_states = len(RATIOS)
    width: float

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return stops in the middle of their range."""
        return stops_at(getattr(s, self.of))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Move the stops by the change between the two instants."""
        return stopped(x, getattr(s1, self.of) - getattr(s0, self.of), self.width)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the stops along each run, without a loop over time."""
        return stops_along(getattr(s, self.of), self.width, starts)


class Branches(Effect):
    """Branches that relax towards a signal, some of them slower than the one of the time constant."""

    of: ClassVar[str]
    """The role of the signal."""
    ratios: ClassVar[tuple[float, ...]]
    """Relaxation times over the time constant."""
    family = "viscoelasticity"
    equations = ("force",)
    source = "10.1007/978-3-642-73602-5"
    time_constant: float

    @property
    def _taus(self) -> list[float]:
        return [ratio * self.time_constant for ratio in self.ratios]

    def start(self, s: Signals, plant: Plant, dt: float) -> Array:
        """Return relaxed branches."""
        return branches_at(getattr(s, self.of), len(self.ratios))

    def step(self, x: Array, s0: Signals, s1: Signals, dt: float, plant: Plant) -> Array:
        """Relax towards the signal."""
        return branches_relax(x, getattr(s0, self.of), getattr(s1, self.of), dt, self._taus)

    def trace(self, s: Signals, plant: Plant, dt: float, starts: Array) -> Array:
        """Return the branches along each run, without a loop over time."""
        return branches_along(getattr(s, self.of), dt, self._taus, starts)


class Deviation(Effect):
    """A number of the simulator file that deviates by a share of it."""

    of: ClassVar[str]
    """Its name there."""
    deviation: float

    def adjust(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the changed number."""
        return {self.of: values[self.of] * (1.0 + self.deviation)}

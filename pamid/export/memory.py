"""What a model with effects remembers, as formulas: how it begins at a first reading, and follows the next ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..effects._terms import added
from ..effects.base import Effect, Signals
from ..effects.plant import Plant
from ..errors import ExportError
from ..signals.state import STATE_SIGNALS, State
from .expression import Symbol, Symbols, as_symbol, in_order, symbol

BEFORE = "was_"
"""Prefix of the signals of the muscle at the instant before."""


@dataclass(frozen=True)
class Memory:
    """The states of a model's effects, as formulas; their symbols are ``x0``, ``x1`` and so on."""

    states: tuple[str, ...]  # names, such as "pressure_hysteresis 1"
    begin: tuple[Symbol, ...]  # eps, deps, P, dP, then states, from the first reading
    follow: tuple[Symbol, ...]  # the same from the next reading, the time dt (s) since the last, was_eps, … and states
    inputs: tuple[Symbol, ...]  # of the network beside the signals of the muscle, from these and the states
    finest: Effect | None = None  # the effect that needs the finest floating type, if any does


class Tracer:
    """Effects of a model, called with symbols."""

    def __init__(self, effects: Sequence[Effect], equations: Sequence[str], plant: Plant) -> None:
        self.effects, self.equations, self.plant = list(effects), list(equations), plant
        self.sensors = [e for e in effects if e.channel == "P" and "measure" in e.hooks()]
        for e in self.sensors:
            if type(e).restore is not Effect.restore and type(e).restore_next is Effect.restore_next:
                raise ExportError(
                    f"The effect {e.name} is undone with the readings before and after, and a controller has no later "
                    "ones.",
                    "effects that follow from the readings so far, such as a tube",
                    "Fit without it, or keep the model in Python.",
                )
        self._names: list[str] = []
        self._places: dict[str, slice] = {}
        for e in self.effects:
            if e.n_states and set(equations) & set(e.hooks()):
                self._new(e.name, e.n_states)
        for e in self.sensors:
            before = symbol("before")
            if any(s is before for s in in_order([as_symbol(e.restore_next(before, symbol("P"), symbol("dt")))])):
                self._new(e.name, 2)

    def _new(self, name: str, n: int) -> None:
        self._places[name] = slice(len(self._names), len(self._names) + n)
        self._names += [f"{name} {k + 1}" for k in range(n)]

    def states(self, effect: Effect) -> Any:
        """Return the symbols of an effect's states; no array entries for one that has none."""
        place = self._places.get(effect.name)
        return np.zeros(0) if place is None else Symbols.of([symbol(f"x{k}") for k in range(place.start, place.stop)])

    def added(self, effect: Effect, equation: str) -> Any:
        """Return an effect's force (N) or flow (kg/s), from the muscle's signals and its states."""
        s: Any = _signals("").with_(time=0.0 * symbol("P"))
        return added(effect, equation, s, self.states(effect), self.plant)

    def memory(self) -> Memory:
        """Return how the states begin and follow the readings, and the network's inputs from them."""
        first, opened = self._restored(None)
        now, followed = self._restored(_signals(BEFORE))
        begin: list[Any] = [0.0] * len(self._names)
        follow: list[Any] = list(begin)
        for effect in self.effects:
            place = self._places.get(effect.name)
            if effect in self.sensors and place is not None:
                begin[place], follow[place] = opened[effect.name], followed[effect.name]
            elif place is not None:
                begin[place] = list(effect.start(first, self.plant, 1.0))
                # Traced once with symbols in place of numbers; the time of a step is one of them, too.
                dt: Any = symbol("dt")
                follow[place] = list(effect.step(self.states(effect), _signals(BEFORE), now, dt, self.plant))
        return Memory(
            tuple(self._names),
            tuple(map(as_symbol, (*_state(first), *begin))),
            tuple(map(as_symbol, (*_state(now), *follow))),
            tuple(self._inputs()),
            min((e for e in self.effects if e.least_difference), key=lambda e: e.least_difference, default=None),
        )

    def _restored(self, before: Signals | None) -> tuple[Signals, dict[str, list[Any]]]:
        """Return the true signals of the muscle for a reading, and the memory of each sensor."""
        now, kept = _signals(""), {}
        for e in self.sensors:
            x, dt = self.states(e), 1.0 if before is None else symbol("dt")
            last = (now.pressure, now.pressure_rate) if before is None or not len(x) else tuple(x)
            P = e.restore_next(last[0], now.pressure, dt)
            rate = e.restore_next(last[1], now.pressure_rate, dt) - e.restore_next(0.0, 0.0, 1.0)
            now, kept[e.name] = now.with_(pressure=P, pressure_rate=rate), [P, rate]
        return now, kept

    def _inputs(self) -> list[Symbol]:
        """Return the terms that tell of the past alone, each once, in the order of the network's inputs."""
        found: dict[tuple[str, str], Symbol] = {}
        for equation in self.equations:
            for effect in self.effects:
                if equation not in effect.hooks() or not effect.n_states:
                    continue
                none = effect.unchecked(**{p.name: 0.0 for p in effect.parameters if p.linear})
                base = self.added(none, equation)
                for p in effect.parameters:
                    if p.linear and p.position == 0 and (effect.name, p.name) not in found:
                        unit = p.nominal or 1e-3 * p.upper
                        term = (self.added(none.unchecked(**{p.name: unit}), equation) - base) / unit
                        found[effect.name, p.name] = as_symbol(term)
        return list(found.values())


def _signals(prefix: str) -> Signals:
    return Signals.of_state(State(*(symbol(prefix + name) for name in STATE_SIGNALS)))


def _state(s: Signals) -> tuple[Any, ...]:
    return s.position, s.velocity, s.pressure, s.pressure_rate

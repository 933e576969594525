"""An effect of the library at a port: its signals, where it enters, and its units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..effects import Effect, Signals
from ..effects.backlash import Play
from ..effects.plant import Surroundings
from ..effects.values import checked_value
from .base import Simulator
from .dimensions import unit_powers
from .lever import Lever
from .links import Link


@dataclass(frozen=True)
class Scales:
    """Sizes that correspond to one in the units of the library's bounds and grids."""

    position: float = 1.0
    """Position that corresponds to a strain of one."""
    time: float = 1.0
    """What a second of the log counts, s."""
    target: float = 1.0
    """Size of one newton."""
    command: float = 1.0
    """Size of a full command."""
    pressure: float = 1.0
    """Size of one pascal."""
    offset: float = 0.0
    """Pressure, Pa, that a gauge reading lacks."""
    ambient: float = 0.0
    """Pressure of the surroundings, Pa; 0 where no gas is stored."""

    def of(self, role: str, x: Any) -> Any:
        """Return a signal in a role in the library's units."""
        if role == "pressure":
            return x * self.pressure + self.offset
        if role == "pressure_rate":
            return x * self.pressure / self.time
        sizes = {"position": self.position, "velocity": self.position * self.time, "command": self.command}
        return x / sizes.get(role, self.target)

    def speed(self, span: float) -> float:
        """Return the size of a speed that covers a range, in the library's units."""
        return 0.5 * span / (self.position * self.time)


@dataclass(frozen=True)
class Placement:
    """An effect at a port."""

    key: str
    """Its name in a diagnosis: effect and port."""
    name: str
    """Name of the effect."""
    port: str
    """Name of the port: where it acts."""
    effect: type[Effect]
    """The library's effect, its parameters bounded by what a log can show."""
    enters: str
    """``"input"``, ``"output"``, ``"state"`` (its rate), ``"parameter"`` or ``"link"``, see `at`."""
    at: str
    """The input, output, state or parameter that it changes; of a link the state of its first end."""
    follows: Mapping[str, str]
    """The signal (state or input) behind each role of the effect."""
    scales: Scales
    """Its units."""
    powers: Mapping[str, int] = field(default_factory=dict)
    """Power of the signal's unit in each parameter, see `pamid.simulators.dimensions.powers`."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units of its parameters."""
    into: str = ""
    """For a loss from a chamber: the state that gets the ``returned`` share of it; empty where none does."""
    lever: Lever | None = None
    """For a force in a mechanism without an input there, how all of it responds."""
    link: Link | None = None
    """For an effect between two ports, both: it follows their differences, and acts on both."""
    also: Mapping[str, str] = field(default_factory=dict)
    """Of an effect on several parameters or readings: the others, by the names that the effect knows them by."""
    numbers: Any = None
    """Numbers of the system that the effect may use, where its owner gives them."""

    # --- values ---------------------------------------------------------------------------------------------
    def factor(self, parameter: str) -> float:
        """Return the factor of a parameter from the library's units to those of the port."""
        s, p = self.scales, next(q for q in self.effect.parameters if q.name == parameter)
        base = {"s": 1.0 / s.time}
        if self.acts:
            base |= {"N": s.target, "Pa": 1.0 / s.pressure}
        if "flow" in self.effect.hooks():  # a flow has the unit of the level's rate
            base |= {"kg": s.target / s.time, "m": (s.target / s.time) ** (1 / 3)}
        factor = 1.0
        for word, power in unit_powers(p.unit).items():
            factor *= base.get(word, 1.0) ** power
        signal = s.position if self.acts else s.command if "command" in self.effect.hooks() else s.target
        return factor * signal ** self.powers.get(parameter, 0)

    @property
    def acts(self) -> bool:
        """Whether it acts like a force or flow, rather than changing a command or a reading."""
        return bool({"force", "torque", "flow"} & set(self.effect.hooks()))

    def outward(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return values of parameters in the units of the port."""
        return {k: float(v) * self.factor(k) for k, v in values.items()}

    def inward(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return values in the units of the port as the library has them, within its bounds."""
        found = {}
        for p in self.effect.parameters:
            if p.name in values:
                found[p.name] = float(np.clip(values[p.name] / self.factor(p.name), p.lower, p.upper))
        return found

    def made(self, values: Mapping[str, float]) -> Effect:
        """Return the effect with values in the port's units; log-dependent bounds limit a search only."""
        found, named = {}, f"{self.name} at {self.port}"
        for p in self.effect.parameters:
            if p.name not in values:
                continue
            unit, factor = self.units.get(p.name, p.unit), self.factor(p.name)
            sized = {unit, p.unit} != {"-"} or bool(self.powers.get(p.name))
            outward = replace(p, unit=unit, lower=p.lower * factor, upper=p.upper * factor)
            outward = outward.of_any_size() if sized else outward
            found[p.name] = checked_value(named, outward, values[p.name], "units are those of the ports") / factor
        return self.effect().unchecked(**found)

    def adjusted(
        self, made: Effect, p: np.ndarray, parameters: Sequence[str], along: np.ndarray | float = 0.5,
        since: np.ndarray | float = 0.0,
    ) -> np.ndarray:  # fmt: skip
        """Return parameters, a row each, as an effect on some of them changes them.

        They are changed at shares of a log, and at times since the beginning of the run, s.
        """
        rows = {word: parameters.index(name) for word, name in {"value": self.at, **self.also}.items()}
        known: dict[str, Any] = {"along": along, "since": since * self.scales.time}
        known |= {word: p[row] for word, row in rows.items()}
        out = p.copy()
        for word, value in made.adjust(known).items():
            out[rows[word]] = value
        return out

    # --- what it adds ---------------------------------------------------------------------------------------
    @property
    def readings(self) -> tuple[str, ...]:
        """The readings that it changes."""
        return (self.at, *self.also.values()) if self.enters == "output" else ()

    @property
    def plant(self) -> Any:
        """Numbers of the system that the effect may use."""
        return self.numbers or Surroundings(self.scales.ambient)

    def signals(self, found: Mapping[str, np.ndarray], t: np.ndarray | None = None) -> Signals:
        """Return the signals that the effect follows, in the library's units; `found` are those of the port's."""
        if self.link is not None:
            found = {**found, **self.link.across(found)}
        out = Signals(**{role: self.scales.of(role, found[name]) for role, name in self.follows.items()})
        if t is not None:
            out.time = t * self.scales.time
        return out

    def force(self, made: Effect, s: Signals, x: Any) -> Any:
        """Return an effect's force, or its rate of a stored quantity, in the unit of the port."""
        total = made.push(s, x, self.plant)
        if "flow" in made.hooks():
            # A bench counts what must flow in, other systems what is stored: at a port it is always a loss. Between
            # two ports it goes from the fuller end to the other, whichever that is, and so it does where below zero
            # something is stored, too, such as a current.
            above = s.pressure - self.scales.offset
            sign = 1.0 if self.link is None and (self.scales.offset or self.scales.ambient) else np.sign(above)
            beyond = s.pressure if np.ndim(sign) == 0 else self.scales.offset + np.abs(above)
            total = total - sign * np.abs(made.flow(s.with_(pressure=beyond), x, self.plant)[0])
        return total * self.scales.target

    def sources(self) -> set[str]:
        """Return the source signals of the effect."""
        both = self.link.sources if self.link is not None else {}
        return {source for name in self.follows.values() for source in both.get(name, (name,))}

    def push(
        self, made: Effect, force: Any, simulator: Simulator,
        at: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], u: np.ndarray, added: np.ndarray,
    ) -> None:  # fmt: skip
        """Apply a force or flow to `u` or to rates `added`, in place; `at`: times, states, inputs, parameters."""
        if self.link is not None and isinstance(made, Play) and self.link.shares is not None:
            self.link.release(made.half_width * self.scales.position, made.damped, simulator, at, added)
        elif self.link is not None:
            self.link.push(force, simulator, at, u, added)
        elif self.enters == "input":
            u[simulator.inputs.index(self.at)] += force
        elif self.lever is not None:
            added[: len(simulator.states)] += self.lever.rates(*at) * force
        else:
            added[simulator.states.index(self.at)] += force
            if self.into:
                added[simulator.states.index(self.into)] -= made.returned * force  # type: ignore[attr-defined]

    def drive(self, made: Effect, u: np.ndarray, dt: float, starts: np.ndarray) -> np.ndarray:
        """Return the input that the system gets where it is given u, along runs."""
        if "command" not in made.hooks():
            return self.reading(made, u, dt, starts)
        s = Signals(command=u / self.scales.command)
        x = made.trace(s, self.plant, dt * self.scales.time, starts)
        return np.asarray(made.command(s.command, s, x, self.plant), dtype=float) * self.scales.command

    def reading(self, made: Effect, y: np.ndarray, dt: float, starts: np.ndarray) -> np.ndarray:
        """Return a sensor's reading of y, along runs."""
        s = Signals(**{role: y / self.scales.target for role in ("position", "force", "flow", "pressure")})
        x = made.trace(s, self.plant, dt * self.scales.time, starts) if made.n_states else np.zeros((0,))
        return np.asarray(made.measure(y / self.scales.target, x), dtype=float) * self.scales.target

    def truth(self, made: Effect, reading: np.ndarray, dt: float, starts: np.ndarray) -> np.ndarray:
        """Return the true values behind the readings of a sensor, along runs."""
        found = made.restore(reading / self.scales.target, dt * self.scales.time, starts)
        return np.asarray(found, dtype=float) * self.scales.target

"""The family of runs for the inputs of any simulator, and the limits that they keep."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from ...errors import ParameterError
from ...simulators.port_log import PortLog
from .rig import Family
from .tones import TONES, motion, slewed

KINDS = ("sine", "triangle", "steps", "multisine", "chirp", "hold")
"""What an input does: a sine, a triangle, steps back and forth, four sines, a sine that becomes faster, or nothing."""
STEPS = 20.0
"""Samples in a period of the fastest sine, so that a log shows it."""
STILL = 0.3
"""Probability that one of several inputs is held."""


@dataclass(frozen=True)
class PortLimits(Family):
    """What the inputs of a rig allow."""

    ranges: Mapping[str, tuple[float, float]]
    """Lowest and highest value of each input, in its unit."""
    rates: Mapping[str, float]
    """Largest rate of each input, per second."""
    interval: float
    """Sampling interval, s."""
    seconds: float = 10.0
    """Time of all runs together, s."""
    runs: int = 1
    """Maximum number of runs, 1 to 5."""
    fastest: float = 0.0
    """Largest frequency, rad/s; by default that of a period of 20 samples."""
    columns: Mapping[str, str] = field(default_factory=dict)
    """Column of each input in a log, where it is not its name."""
    keeps: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Range in which readings are to stay, where that is not what the logs have visited and as much again."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Unit of each input, for a reader."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Inputs that are held at a value."""
    kinds: tuple[str, ...] = KINDS[:-1]
    """The kinds of runs that there can be, of `KINDS`."""
    options: ClassVar[str] = "--limit, --rate, --keep, --seconds"
    """Options of the command line that widen them."""
    header: ClassVar[str] = "Runs: seconds, rad/s and the units of the inputs; set_points.csv has them row by row."

    def __post_init__(self) -> None:
        least = STEPS * self.interval
        self._refuse_times(least, math.inf, f"at least {least:g} s a run")
        for name, (low, high) in self.ranges.items():
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise ParameterError(f"The limits of {name} are {low:g} to {high:g}.", "a range", "Correct them.")
        for name, rate in self.rates.items():
            if not rate > 0.0:
                raise ParameterError(f"The largest rate of {name} is {rate:g}.", "a positive number", "Correct it.")

    @classmethod
    def of(
        cls,
        logs: Sequence[tuple[PortLog, Mapping[str, np.ndarray]]],
        ranges: Mapping[str, tuple[float, float]] = MappingProxyType({}),
        rates: Mapping[str, float] = MappingProxyType({}),
        **given: Any,
    ) -> PortLimits:
        """Return the limits within which inputs moved in logs, each with its inputs, and those that a user gives."""
        dt, spans, most = logs[-1][0].dt, dict[str, tuple[float, float]](), dict[str, float]()
        for name in logs[-1][1]:
            u = np.concatenate([inputs[name] for _, inputs in logs])
            if np.ptp(u) > 0.0:
                spans[name] = float(np.min(u)), float(np.max(u))
        for name, (low, high) in (every := {**spans, **ranges}).items():
            seen = spans.get(name, (0.0, 0.0))
            parts = [x[name][a:b] for log, x in logs for a, b in log.spans] if name in spans else []
            fastest = max((float(np.max(np.abs(np.diff(u)), initial=0.0)) for u in parts), default=0.0) / dt
            # A wider range is covered in the same time.
            usual = fastest * max(1.0, (high - low) / (seen[1] - seen[0])) if fastest else (high - low) / dt
            most[name] = rates.get(name) or usual
        if not every:
            raise ParameterError(
                "No input of the simulator moves in the logs.",
                "an input that can be driven",
                "Give its range: --limit u=-1:1.",
            )
        return cls(every, most, dt, **given)

    @property
    def top(self) -> float:
        """Largest frequency, rad/s."""
        highest = 2.0 * math.pi / (STEPS * self.interval)
        return min(self.fastest, highest) if self.fastest > 0.0 else highest

    def draw(self, rng: np.random.Generator, kind: str) -> PortRun:
        """Draw a run within the limits: one kind for all inputs, of which some are held where there are several."""
        names, waves = list(self.ranges), {name: Wave("hold", value) for name, value in self.held.items()}
        moving = [len(names) == 1 or rng.random() > STILL for _ in names]
        if names:
            moving[int(rng.integers(len(names)))] = True
        slowest = min(2.0 * math.pi / self.each, self.top)
        for name, moves in zip(names, moving, strict=True):
            low, high = self.ranges[name]
            top = self.top / {"multisine": TONES[-1], "chirp": 5.0}.get(kind, 1.0)
            waves[name] = self._within(
                Wave(
                    kind if moves else "hold",
                    float(rng.uniform(low, high)) if rng.random() < 0.6 else 0.5 * (low + high),
                    float(0.5 * (high - low) * rng.uniform(0.1, 1.0)),
                    float(np.exp(rng.uniform(math.log(slowest), math.log(max(top, 1.01 * slowest))))),
                    int(rng.integers(0, 10_000)),
                ),
                name,
            )
        return PortRun(kind, self.each, waves, self)

    def near(self, rng: np.random.Generator, run: PortRun, share: float) -> PortRun:
        """Draw a run of the same kind close to another one."""
        waves = dict(run.inputs)
        for name, wave in run.inputs.items():
            if name in self.held:
                continue
            (low, high), step = self.ranges[name], rng.normal(0.0, share, 3)
            waves[name] = self._within(
                replace(
                    wave,
                    middle=wave.middle + 0.5 * (high - low) * step[0],
                    amplitude=wave.amplitude + 0.5 * (high - low) * step[1],
                    frequency=wave.frequency * math.exp(1.5 * step[2]),
                    seed=int(rng.integers(0, 10_000)) if rng.random() < STILL else wave.seed,
                ),
                name,
            )
        return replace(run, inputs=waves)

    def _within(self, wave: Wave, name: str) -> Wave:
        """Return the wave closest to one that keeps the limits; a hold may be anywhere."""
        low, high = self.ranges[name]
        fastest = {"multisine": float(TONES[-1]), "chirp": 5.0}.get(wave.kind, 1.0)
        w = float(np.clip(wave.frequency, math.pi / self.each, self.top / fastest))
        middle = float(np.clip(wave.middle, low, high))
        if wave.kind == "hold":
            return replace(wave, middle=middle, amplitude=0.0)
        half = 0.5 * (high - low)
        middle = float(np.clip(middle, low + 0.1 * half, high - 0.1 * half))
        room = min(middle - low, high - middle)
        # A sine passes its middle at w times its amplitude; a step has half a period to get across.
        room = min(room, self.rates[name] * (0.5 * math.pi if wave.kind == "steps" else 1.0) / (w * fastest))
        return replace(wave, middle=middle, amplitude=float(np.clip(abs(wave.amplitude), 0.0, room)), frequency=w)


@dataclass(frozen=True)
class Wave:
    """What one input does."""

    kind: str
    """Of `KINDS`."""
    middle: float
    amplitude: float = 0.0
    """About which value, and how far, in the unit of the input."""
    frequency: float = 1.0
    """rad/s; of a multisine the lowest, of a chirp the first."""
    seed: int = 0
    """Of a multisine, the seed of its phases."""

    def values(self, t: np.ndarray, rate: float) -> np.ndarray:
        """Return the input at times, no faster than a rate."""
        x = motion(self.kind, t, self.amplitude, self.frequency, self.seed)
        return slewed(self.middle + x, rate * float(t[1] - t[0]))

    def words(self, name: str, unit: str = "-") -> str:
        """What the input does, for a reader."""
        shown = "" if unit == "-" else f" {unit}"
        w, a, at = (
            f"{_plain(self.frequency)} rad/s",
            f"{_plain(abs(self.amplitude))}{shown}",
            _plain(self.middle) + shown,
        )
        return {
            "sine": f"a sine in {name} of {w} and {a} about {at}",
            "triangle": f"a triangle in {name} of {w} and {a} about {at}",
            "steps": f"steps in {name} of {a} to either side of {at}, one every {_plain(math.pi / self.frequency)} s",
            "multisine": f"a sum of four sines in {name}, the slowest of {w}, together of {a} about {at}",
            "chirp": f"a sine in {name} of {a} about {at} that goes from {w} to five times that",
            "hold": f"{name} held at {at}",
        }[self.kind]


@dataclass(frozen=True)
class PortRun:
    """One run of the family."""

    kind: str
    """What most inputs do."""
    seconds: float
    """Length, s."""
    inputs: Mapping[str, Wave]
    """What each input does."""
    limits: PortLimits = field(repr=False)
    """What the rig allows."""

    @property
    def time(self) -> np.ndarray:
        """Times of the samples, s."""
        return np.arange(round(self.seconds / self.limits.interval) + 1) * self.limits.interval

    def values(self) -> dict[str, np.ndarray]:
        """Return each input, sample by sample."""
        t = self.time
        rates = self.limits.rates
        return {name: wave.values(t, rates.get(name, math.inf)) for name, wave in self.inputs.items()}

    def set_points(self, name: str) -> pd.DataFrame:
        """Return each input in its column, sample by sample."""
        columns = {self.limits.columns.get(k, k): v for k, v in self.values().items()}
        return pd.DataFrame({"trajectory": name, "time": np.round(self.time, 9), **columns})

    @property
    def words(self) -> str:
        """What the run is, for a reader."""
        moved = sorted(self.inputs.items(), key=lambda one: one[1].kind == "hold")
        units = self.limits.units
        return f"{'; '.join(w.words(name, units.get(name, '-')) for name, w in moved)}, for {_plain(self.seconds)} s"

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers of the run."""
        return {"kind": self.kind, "seconds": self.seconds, "inputs": {n: vars(w) for n, w in self.inputs.items()}}


def _plain(x: float) -> str:
    """Return three digits without a power of ten, as far as that is short."""
    return f"{float(f'{x:.3g}'):g}"

"""The continuous family of runs that a design chooses from, within the limits of the bench."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from ...bench import references
from ...bench.references import LEAD, PERIOD, Trajectory
from ...errors import ParameterError, UnknownOptionError
from ...names import refuse_others, require_one_of
from .rig import Family
from .tones import TONES, motion, slewed

KINDS = ("sine", "triangle", "steps", "multisine", "hold", "isobaric", "isometric", "sealed")
"""A sine, a triangle, square steps, four sines, the joint held, a sine during which one muscle stays at constant
pressure, pressures that rise and fall with the joint held, and valves that shut after a sine."""
READ = {
    "hold": (),
    "steps": ("frequency", "amplitude", "rate"),
    "multisine": ("frequency", "amplitude", "seed"),
    "isobaric": ("frequency", "amplitude", "muscle"),
    "isometric": ("frequency", "rise"),
    "sealed": ("frequency", "amplitude", "shut"),
}
"""What else than seconds, offset and pressure a kind reads, where that is not frequency and amplitude alone."""
LEAST_PRESSURE = 1e3
"""Pa: a smaller change of pressure moves nothing, and was stated in bar or kPa."""


@dataclass(frozen=True)
class Limits(Family):
    """What the bench allows."""

    seconds: float = 4.0
    """Time of all runs together, s."""
    runs: int = 1
    """Maximum number of runs, 1 to 5."""
    angle: float = 25.0
    """Largest reference angle, degrees to either side."""
    rate: float = 200.0
    """Largest rate of the reference angle, degrees/s."""
    frequency: float = 15.0
    """Largest frequency, rad/s."""
    pressure: float = 8e4
    """How far the mean pressure of both muscles may be from its usual value, Pa."""
    rise: float = 1.2e5
    """How far both pressures may rise and fall together, Pa."""
    shut: bool = True
    """Whether the valves may be shut."""
    single: bool = True
    """Whether one muscle may be kept at constant pressure while the other one moves the joint."""
    options: ClassVar[str] = "--angle, --pressure, --rise"
    """Options of the command line that widen them."""
    header: ClassVar[str] = "Runs for 'pamid simulate --runs': seconds, rad/s, degrees, Pa."

    def __post_init__(self) -> None:
        self._refuse_times(0.5, 600.0, "0.5 to 600 s a run")
        for name in ("angle", "rate", "frequency"):
            if not 0.0 < getattr(self, name) < 1e5:
                raise ParameterError(f"{name} is {getattr(self, name)!r}.", "a positive number", "Correct the limit.")
        if self.angle > 180.0:
            raise ParameterError(
                f"angle is {self.angle:g} degrees.", "180 at most, to either side", "Correct the limit."
            )
        for name in ("pressure", "rise"):
            value, expected = getattr(self, name), f"0, or {LEAST_PRESSURE:g} to 1e7 Pa"
            if value != 0.0 and not LEAST_PRESSURE <= value < 1e7:
                raise ParameterError(f"{name} is {value!r} Pa.", expected, "State it in Pa: 0.8 bar are 80000.")

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of runs that are allowed."""
        out = {*(() if self.shut else ("sealed",)), *(() if self.single else ("isobaric",))}
        out |= set() if self.rise > 0.0 else {"isometric"}
        return tuple(k for k in KINDS if k not in out)

    def draw(self, rng: np.random.Generator, kind: str) -> DesignedRun:
        """Draw a run of a kind."""
        slowest = min(2.0 * math.pi / self.each, self.frequency)
        top = self.frequency / (TONES[-1] if kind == "multisine" else 1.0)
        run = DesignedRun(
            kind,
            self.each,
            frequency=float(np.exp(rng.uniform(math.log(0.7 * slowest), math.log(max(top, slowest))))),
            amplitude=float(self.angle * rng.uniform(0.15, 1.0)),
            offset=float(self.angle * rng.uniform(-0.7, 0.7)) if rng.random() < 0.6 or kind == "hold" else 0.0,
            pressure=float(self.pressure * rng.uniform(-1.0, 1.0)) if rng.random() < 0.5 else 0.0,
            rise=float(self.rise * rng.uniform(0.2, 1.0)),
            muscle=int(rng.integers(1, 3)),
            shut=float(rng.uniform(0.2, 0.6)),
            seed=int(rng.integers(0, 10_000)),
            rate=self.rate,
        )
        return self.within(run)

    def near(self, rng: np.random.Generator, run: DesignedRun, share: float) -> DesignedRun:
        """Draw a run of the same kind close to another one, within a share of the limits."""
        step = rng.normal(0.0, share, 6)
        moved = replace(
            run,
            frequency=run.frequency * math.exp(1.5 * step[0]),
            amplitude=run.amplitude + self.angle * step[1],
            offset=run.offset + self.angle * step[2],
            pressure=run.pressure + self.pressure * step[3],
            rise=float(np.clip(run.rise + self.rise * step[4], 0.05 * self.rise, self.rise)),
            shut=float(np.clip(run.shut + 0.5 * step[5], 0.15, 0.8)),
            seed=int(rng.integers(0, 10_000)) if run.kind == "multisine" and rng.random() < 0.3 else run.seed,
        )
        return self.within(moved)

    def within(self, run: DesignedRun) -> DesignedRun:
        """Return the run closest to one that keeps the limits."""
        fastest = TONES[-1] if run.kind == "multisine" else 1.0
        w = float(np.clip(run.frequency, 0.1, self.frequency / fastest))
        offset = float(np.clip(run.offset, -0.9 * self.angle, 0.9 * self.angle))
        room = self.angle - abs(offset)
        if run.kind not in ("steps", "hold", "isometric"):
            room = min(room, self.rate / (w * (fastest if run.kind == "multisine" else 1.0)))
        a = float(np.clip(abs(run.amplitude), 0.0, room))
        if run.kind == "steps":
            a = -a if offset > 0.0 else a  # away from the limit
            a = float(np.clip(a, -self.angle - offset, self.angle - offset))
        pressure = float(np.clip(run.pressure, -self.pressure, self.pressure))
        return replace(run, frequency=w, offset=offset, amplitude=a, pressure=pressure)


@dataclass(frozen=True)
class DesignedRun:
    """One run of the family."""

    kind: str
    """Of `KINDS`."""
    seconds: float
    """Length, s."""
    frequency: float = 4.0
    """rad/s; the lowest of a multisine, half the turns of steps."""
    amplitude: float = 10.0
    """Of the motion, degrees."""
    offset: float = 0.0
    """Angle about which it moves, degrees."""
    pressure: float = 0.0
    """Added to the mean pressure of both muscles, Pa."""
    rise: float = 0.0
    """Of an isometric run, how far both pressures rise and fall, Pa."""
    muscle: int = 1
    """Of an isobaric run, the muscle at constant pressure."""
    shut: float = 0.4
    """Of a sealed run, when the valves shut, as a share of its length."""
    seed: int = 0
    """Of a multisine, the seed of its phases."""
    rate: float = 200.0
    """Largest rate of the reference angle, degrees/s, which rounds steps."""

    def __post_init__(self) -> None:
        require_one_of(self.kind, KINDS, f"There is no kind of run {self.kind!r}.", "Correct it.")
        if self.muscle not in (1, 2):
            raise UnknownOptionError(f"There is no muscle {self.muscle!r}.", "1 or 2", "Correct it.")
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name != "kind" and not (isinstance(value, (int, float)) and math.isfinite(value)):
                raise ParameterError(f"{f.name} of a run is {value!r}.", "a finite number", "Correct it.")
        if not (0.1 <= self.seconds <= 600.0 and self.frequency > 0.0 and self.rate > 0.0 and 0.0 < self.shut < 1.0):
            raise ParameterError(
                f"A run has seconds {self.seconds:g}, frequency {self.frequency:g}, rate {self.rate:g} and shut "
                f"{self.shut:g}.",
                "0.1 to 600 s, a positive frequency and rate, and shut between 0 and 1",
                "Correct it.",
            )

    def trajectory(self, name: str) -> Trajectory:
        """Return the references of the controller, from rest at angle 0 through a lead-in that is not recorded."""
        lead, n = round(LEAD / PERIOD), round(self.seconds / PERIOD)
        t = (np.arange(n + lead) - lead) * PERIOD
        ease = np.clip(1.0 + t / (0.7 * LEAD), 0.0, 1.0)
        ease = ease * ease * (3.0 - 2.0 * ease)
        shape = {"isobaric": "sine", "sealed": "sine"}.get(self.kind, self.kind)
        moved = motion(shape, t, self.amplitude, self.frequency, self.seed, low=0.0)
        q = np.radians(ease * (self.offset + moved))
        q = slewed(q, math.radians(self.rate) * PERIOD) if self.kind == "steps" else q
        offset = ease * self.pressure
        if self.kind == "isometric":
            offset = offset + 0.5 * self.rise * (1.0 - np.cos(self.frequency * np.maximum(t, 0.0)))
        share = {"isobaric": ((0.0, 2.0), (2.0, 0.0))[self.muscle - 1]}.get(self.kind, (1.0, 1.0))
        sealed = t >= self.shut * self.seconds if self.kind == "sealed" else None
        return Trajectory(name, q, lead, offset if np.any(offset) else None, share, sealed)

    def set_points(self, name: str) -> pd.DataFrame:
        """Return the references of the controller, sample by sample, see `Plan.set_points`."""
        run = self.trajectory(name)
        n = len(run.q_ref)
        return pd.DataFrame(
            {
                "trajectory": run.name,
                "time": np.round((np.arange(n) - run.lead) * PERIOD, 6),
                "q_ref": np.round(run.q_ref, 7),
                "p_offset": 0.0 if run.pressure_offset is None else np.round(run.pressure_offset, 2),
                "share1": run.share[0],
                "share2": run.share[1],
                "shut": 0 if run.sealed is None else run.sealed.astype(int),
            }
        )

    @property
    def words(self) -> str:
        """What the run is, for a reader."""
        w, a = f"{self.frequency:.3g} rad/s", f"{abs(self.amplitude):.3g} degrees"
        about = f" about {self.offset:.3g} degrees" if abs(self.offset) > 0.5 else ""
        mean = f", mean pressure changed by {self.pressure / 1e5:+.2g} bar" if abs(self.pressure) > 1e3 else ""
        said = {
            "sine": f"a sine of {w} and {a}{about}",
            "triangle": f"a triangle of {w} and {a}{about}",
            "steps": f"steps of {a} from {self.offset:.3g} degrees and back every {math.pi / self.frequency:.2g} s",
            "multisine": f"a sum of four sines, the slowest of {w}, together of {a}{about}",
            "hold": f"the joint held at {self.offset:.3g} degrees",
            "isobaric": f"a sine of {w} and {a}{about} with muscle {self.muscle} at constant pressure",
            "isometric": f"the joint held at {self.offset:.3g} degrees while both pressures rise and fall by "
            f"{self.rise / 1e5:.2g} bar, as a sine of {w}",
            "sealed": f"a sine of {w} and {a}{about}, both valves shut after {self.shut * self.seconds:.2g} s",
        }[self.kind]
        return f"{said}{mean}, {self.seconds:.3g} s"

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers of the run that its kind reads."""
        read = {"kind", "seconds", "offset", "pressure", *READ.get(self.kind, ("frequency", "amplitude"))}
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name in read}

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> DesignedRun:
        """Return the run that numbers say; one that does not exist raises."""
        known = {f.name for f in fields(cls)}
        refuse_others(found, known, "A run has no", f"any of {', '.join(sorted(known))}")
        if not {"kind", "seconds"} <= set(found):
            raise ParameterError(
                "A run lacks kind or seconds.", "both", "Write for instance kind = 'sine', seconds = 4."
            )
        return cls(**found)


SAMPLES = 2000
"""Length of a standard run, ms."""


class StandardRun:
    """A run of a bench as ``pamid simulate --trajectory`` takes it."""

    def __init__(self, kind: str, **numbers: float) -> None:
        self.kind, self.numbers = kind, numbers

    def trajectory(self, name: str) -> Trajectory:
        """Return the references of the controller."""
        return replace(getattr(references, self.kind)(**self.numbers, samples=SAMPLES), name=name)

    def as_dict(self) -> dict[str, Any]:
        """Return its numbers."""
        return {"kind": self.kind, **self.numbers}


STANDARD = [
    StandardRun("sine", frequency=1.0, amplitude=15.0),
    StandardRun("sine", frequency=10.0, amplitude=15.0),
    StandardRun("triangle", frequency=1.0, amplitude=20.0),
    StandardRun("step", start=0.0, end=20.0),
    StandardRun("multisine", frequency=10.0, amplitude=10.0),
    StandardRun("hold", angle=10.0),
    StandardRun("sealed_hold", angle=10.0),
    StandardRun("isobaric", frequency=4.0, amplitude=10.0),
    StandardRun("isometric", angle=0.0, rise=1e5),
]
"""What a bench can easily record."""

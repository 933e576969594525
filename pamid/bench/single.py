"""One muscle that lifts a load under PID pressure control: the bench of the inverse model."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..constants import GRAVITY
from ..effects.spec import EffectLike, EffectSpec, as_effects
from ..errors import DivergedError, ParameterError
from ..explained import explained_by
from .integrate import RungeKutta4
from .muscles import Muscles
from .parameters import BenchParameters, GasParameters, JointParameters, MuscleParameters, ValveParameters
from .references import PERIOD
from .sensors import Sensor

LOADS = (15.0, 30.0, 45.0, 60.0, 80.0, 100.0)
"""Loads of the study, kg."""

SENSORS: Mapping[str, Sensor] = {
    "P": Sensor(60.0, 1e6 / 2**16),
    "L": Sensor(2e-5, 1e-5),
    "F": Sensor(0.3, 2000.0 / 2**16),
}
"""Sensors of the single muscle: pressure (Pa), length by a draw wire (m), load cell (N)."""


@dataclass(frozen=True)
class LiftSettings:
    """What is around the muscle.

    Examples
    --------
    >>> from pamid.bench.single import LiftSettings
    >>> LiftSettings(frequency=0.25).peak  # Pa gauge
    700000.0
    """

    frequency: float = 0.05
    """Of the desired pressure, Hz."""
    peak: float = 7e5
    """Largest desired pressure, Pa gauge; the least is 0."""
    proportional: float = 2e-5
    integral: float = 2e-4
    derivative: float = 0.0
    """Gains of the pressure controller, 1/Pa, 1/(Pa s), s/Pa."""
    stand_stiffness: float = 5e6
    """Of the stand on which the load rests until it is lifted, N/m."""
    damping: float = 60.0
    """Of the guide of the load, N s/m."""


def festo_like() -> BenchParameters:
    """Return a 20 mm muscle with conical ends and braid hysteresis: about 1.5 kN at 6 bar, at most 25 % contraction."""
    return BenchParameters(
        MuscleParameters("20mm", 0.2, 0.02, math.radians(25.0), 0.0),
        GasParameters(supply_pressure=901_325.0),
        ValveParameters(6e-9),
        JointParameters(0.04, 0.02, 0.08),
        effects=(
            EffectSpec("end_cap", {"factor": 1.35}),
            EffectSpec("hysteresis", {"amplitude": 20.0, "displacement": 0.02, "shape": 0.6}),
        ),
    )


class LiftBench:
    """Muscles that lift loads side by side under PID control of their pressures, one control period at a time."""

    def __init__(
        self,
        params: BenchParameters,
        mass: np.ndarray,
        *,
        effects: Sequence[EffectLike] = (),
        settings: LiftSettings | None = None,
        substeps: int = 1,
    ) -> None:
        everything = [*params.make_effects(), *as_effects(effects)]
        if wrong := [e.name for e in everything if e.channel or e.site == "joint"]:
            raise ParameterError(
                f"{', '.join(wrong)} cannot enter the bench of one muscle.",
                "effects of muscle, gas or valve",
                "Leave it out.",
            )
        specs = tuple((e.name, e.values) for e in everything if "adjust" in e.hooks())
        actual = params.replace(effects=specs).adjusted()
        self.settings = settings or LiftSettings()
        self._load(mass)
        self.substeps = substeps
        n = self.mass.size
        self._rest_length = actual.muscle.rest_length
        self._muscles = Muscles(actual, (1, n), [e for e in everything if "adjust" not in e.hooks()])
        self._y = np.empty((3, n))
        self._y[0] = self._rest_length + self.mass * GRAVITY / self.settings.stand_stiffness
        self._y[1], self._y[2] = 0.0, actual.gas.atmospheric_pressure + 1.0
        self._solver = RungeKutta4(self._rates, self._y.shape)
        self._total, self._last, self._held = np.zeros(n), np.zeros(n), np.zeros((1, n))
        self._count = 0

    def _load(self, mass: np.ndarray) -> None:
        self.mass = np.array(mass, dtype=float)
        self._stand_damping = np.sqrt(self.settings.stand_stiffness * self.mass)  # half of critical

    def _rates(self, y: np.ndarray, out: np.ndarray, ahead: float) -> None:
        self._muscles.evaluate(y[:1], y[1:2], y[2:], out[2:], ahead)
        sunk = y[0] - self._rest_length
        stand = np.maximum(self.settings.stand_stiffness * sunk + self._stand_damping * y[1], 0.0) * (sunk > 0.0)
        out[0] = y[1]
        out[1] = GRAVITY - (self._muscles.F[0] + self.settings.damping * y[1] + stand) / self.mass

    @property
    def length(self) -> np.ndarray:
        """Length of each muscle now, m."""
        return self._y[0].copy()

    def step(
        self, wanted: Any, mass: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Control and integrate one period of 1 ms."""
        settings, y = self.settings, self._y
        if mass is not None:
            self._load(mass)
        error = wanted - y[2]
        rate = (error - self._last) / PERIOD if self._count else np.zeros_like(error)
        self._last = error
        raw = settings.proportional * error + settings.integral * self._total + settings.derivative * rate
        u = np.clip(raw, -1.0, 1.0)[None]
        self._total += PERIOD * error * (raw == u[0])  # the integral rests while the valve is saturated
        self._muscles.hold(u)
        if self._count == 0:
            self._muscles.start_memory(y[:1], y[1:2].copy(), y[2:].copy(), PERIOD)
        else:
            self._muscles.sample_memory(self._held, PERIOD)
        self._held = u
        for i in range(self.substeps):
            self._solver.first(y)
            if i == 0:
                reading = y[2].copy(), y[0].copy(), self._muscles.F[0].copy(), u[0]
            self._solver.advance(y, PERIOD / self.substeps)
            self._muscles.carry_memory(y[:1].copy(), y[1:2].copy(), y[2:].copy(), PERIOD / self.substeps)
        self._count += 1
        return reading

    def check(self) -> None:
        """Raise unless the state is finite."""
        if not np.all(np.isfinite(self._y)):
            raise DivergedError(
                "The simulation of the lift diverged.", "a motion that the bench can make", "Raise substeps."
            )


@explained_by(LiftBench)
def simulate_lift(
    params: BenchParameters | None = None,
    loads: Sequence[float] = LOADS,
    *,
    periods: float = 1.0,
    every: int = 10,
    seed: int | None = 0,
    effects: Sequence[EffectLike] = (),
    settings: LiftSettings | None = None,
    sensors: Mapping[str, Sensor] | None = None,
    substeps: int = 1,
) -> Any:
    r"""Simulate one muscle lifting loads, all side by side.

    .. math:: m\,\ddot L = m g - F - d\,\dot L - N

    with the force N of the stand that carries the load until the muscle does.

    Parameters
    ----------
    params : BenchParameters, optional
        Muscle, gas and valve, with effects; `festo_like` by default. The joint is not looked at.
    loads : sequence of float, default=(15, 30, 45, 60, 80, 100)
        kg, each once.
    periods : float, default=1
        Periods of the desired pressure.
    every : int, default=10
        Milliseconds between rows.
    seed : int, default=0
        Seed of the sensors' noise.
    sensors : mapping of str to Sensor, optional
        Noise and resolution of ``P``, ``L``, ``F``.

    Returns
    -------
    DataFrame
        Columns ``trajectory`` (``lift-<load>``), ``time`` (s), ``P_ref``, ``P`` (Pa, absolute), ``L`` (m), ``eps``,
        ``F`` (N), ``u``, ``load`` (kg).

    Examples
    --------
    >>> from pamid.bench.single import simulate_lift
    >>> log = simulate_lift(loads=[30.0], periods=0.05)
    >>> list(log.columns)
    ['trajectory', 'time', 'P_ref', 'P', 'L', 'eps', 'F', 'u', 'load']
    """
    mass = np.asarray(loads, dtype=float)
    if mass.ndim != 1 or not mass.size or not np.all((mass > 0) & (mass < 1e4)) or len(set(loads)) < mass.size:
        raise ParameterError(f"loads is {loads!r}.", "different masses in kg, above 0", "List each load once.")
    if every < 1 or periods <= 0:
        raise ParameterError(f"every is {every!r} and periods {periods!r}.", "both above 0", "Correct them.")
    params, settings = params or festo_like(), settings or LiftSettings()
    bench = LiftBench(params, mass, effects=effects, settings=settings, substeps=substeps)
    steps = round(periods / settings.frequency / PERIOD)
    t = np.arange(steps) * PERIOD
    ambient = params.gas.atmospheric_pressure
    wanted = ambient + 0.5 * settings.peak * (1.0 - np.cos(2.0 * math.pi * settings.frequency * t))
    rows, n = np.arange(0, steps, every), mass.size
    P, L, F, U = (np.empty((len(rows), n)) for _ in range(4))
    for k in range(steps):
        reading_now = bench.step(wanted[k])
        if k % every == 0:
            P[k // every], L[k // every], F[k // every], U[k // every] = reading_now
    bench.check()
    reading = {**SENSORS, **(sensors or {})}
    parts = []
    for j, rng in enumerate(np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(n)):
        length = reading["L"].read(L[:, j], rng)
        parts.append(
            pd.DataFrame(
                {
                    "trajectory": np.full(len(rows), f"lift-{mass[j]:g}", dtype=object),
                    "time": np.round(rows * PERIOD, 9),
                    "P_ref": wanted[rows],
                    "P": reading["P"].read(P[:, j], rng),
                    "L": length,
                    "eps": 1.0 - length / params.muscle.rest_length,
                    "F": reading["F"].read(F[:, j], rng),
                    "u": U[:, j],
                    "load": mass[j],
                }
            )
        )
    return pd.concat(parts, ignore_index=True)

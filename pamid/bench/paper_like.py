"""The bench and the runs of the data sets ``paper_like``: the bench as the data of the study's authors are.

Stated by the authors, in the paper or their public notebooks: the flow is computed by the valve's map from command and
pressure, not metered; a PD controller tracks sines at 1 kHz, five frequencies by the text, in 20 runs; 39,330 rows of B
and 38,690 of C at 100 Hz; mean and variance of the flow of A and B, the first losses of B and C.

Inferred: five frequencies and four amplitudes in runs of four periods last 387.0 s, C's length to 0.2 s; B is longer by
one period of 1 rad/s. Slow runs then last longer than fast ones, and that alone makes the flow heavy-tailed: where it
goes as frequency times amplitude its kurtosis is 27 for amplitudes of 10 to 25 degrees, against 7 for runs of one
length. It also leaves two or three of 315 rows to the fastest and largest run, so that one row carries much of the loss
of an adaptation, as it does with the authors. Runs start from rest, and the spool lags the command that the map reads.
Muscle A has half of B's flow, not a quarter of it: valve and tube are the same for all, pressures are not.

Chosen, so that spread, mean and kurtosis of the flow come out: the numbers of `SETTINGS` and of `paper_like_bench`, the
latter with the authors' loss on B in sight as well; how long a step takes, with their errors on steps in sight; the
noise; which four amplitudes, by the kurtosis; which run of B is longer. A, of which nothing is said, has C's runs.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..laws.valve import Valve
from .controller import Controller
from .parameters import BenchParameters
from .references import PERIOD, Trajectory

FREQUENCIES = (0.5, 1.0, 2.0, 4.0, 10.0)
"""Frequencies of sines and triangles, rad/s."""
AMPLITUDES = (10.0, 15.0, 20.0, 25.0)
"""Amplitudes of the sines, degrees; triangles and steps have 5 as well."""
PERIODS = 4
"""Periods of a run."""
STEP_SAMPLES = 5_000
"""Samples of one step run; the step comes after 1 s."""
RISE = 0.12
"""Time that a step takes, s; chosen: the flow stays in the range of the sines, and errors are of Table 2's size."""
NORMAL_LITRE = 2.1542e-5
"""One NL/min, kg/s, as the authors' notebooks convert it."""
NOISE = 0.5
"""Standard deviation of the flow that the map gives, NL/min."""
REST = 0.3
"""Time at rest before each run, s, not recorded."""


@dataclass(frozen=True)
class Setting:
    """What is chosen for one muscle: its controller, ε₀ and the offset of its map (NL/min)."""

    controller: Controller
    initial_contraction: float
    offset: float


SETTINGS = {
    "A": Setting(Controller(pressure=4.2e5, bandwidth=40.0, pressure_time=16e-3), 0.21, 0.25),
    "B": Setting(Controller(pressure=3.28e5, bandwidth=62.0, pressure_time=12e-3), 0.12, 0.40),
    "C": Setting(Controller(pressure=4.0e5, bandwidth=34.0, pressure_time=12e-3), 0.12, 0.43),
}
"""By muscle; the offsets give the mean flows that the authors name of A and B, and B's to C."""


def paper_like_bench(muscle: str) -> BenchParameters:
    """Return the bench of the data sets ``paper_like``.

    One valve of 300 NL/min and one tube for all muscles; the tube's volume and the spool's lag are effects beyond the
    simulator.

    Parameters
    ----------
    muscle : str
        ``"A"``, ``"B"`` or ``"C"``.

    Returns
    -------
    BenchParameters
        The bench.

    Examples
    --------
    >>> from pamid.bench import paper_like_bench
    >>> [name for name, _ in paper_like_bench("B").effects]
    ['dead_volume', 'valve_lag']
    """
    bench = BenchParameters.for_muscle(muscle)
    return bench.replace(
        initial_contraction=SETTINGS[muscle].initial_contraction,
        pulley_radius=0.045,
        viscous_damping=0.2,
        sonic_conductance=8.3e-9,
        effects=[("dead_volume", {"volume": 3e-5}), ("valve_lag", {"time_constant": 6e-3, "second": 0.25})],
    )


def _run(kind: str, frequency: float, amplitude: float, periods: int) -> Trajectory:
    samples, lead = round(periods * 2.0 * math.pi / frequency / PERIOD), round(REST / PERIOD)
    wave = np.sin(frequency * PERIOD * np.maximum(np.arange(samples + lead) - lead, 0))
    if kind == "triangle":
        wave = 2.0 / math.pi * np.arcsin(wave)
    return Trajectory(f"{kind}-{frequency:g}-{amplitude:g}", math.radians(amplitude) * wave, lead)


def sines(muscle: str) -> list[Trajectory]:
    """Return the 20 training sines of a muscle; one of B has a period more."""
    return [_run("sine", f, a, PERIODS + ((muscle, f, a) == ("B", 1.0, 10.0))) for f in FREQUENCIES for a in AMPLITUDES]


def triangles(muscle: str) -> list[Trajectory]:
    """Return the 25 triangles, the same for all muscles."""
    del muscle
    return [_run("triangle", f, a, PERIODS) for f in FREQUENCIES for a in (5.0, *AMPLITUDES)]


def steps(muscle: str) -> list[Trajectory]:
    """Return the 10 steps, the same for all muscles; each takes `RISE`."""
    del muscle
    lead = round(REST / PERIOD)
    share = np.clip((np.arange(STEP_SAMPLES + lead) - lead - 1.0 / PERIOD) * PERIOD / RISE, 0.0, 1.0)
    rise = 0.5 - 0.5 * np.cos(math.pi * share)
    ends = [sign * a for a in (5.0, *AMPLITUDES) for sign in (1.0, -1.0)]
    return [Trajectory(f"step-0-{end:g}", math.radians(end) * rise, lead) for end in ends]


def flow_by_map(log: Any, bench: BenchParameters, seed: int | None) -> None:
    """Put the flow that the valve's nominal map gives at command and pressure in the place of the true one."""
    gas, nominal = bench.gas, bench.valve
    valve = Valve(
        nominal.sonic_conductance,
        nominal.critical_pressure_ratio,
        gas.supply_pressure,
        gas.atmospheric_pressure,
        nominal.reference_density,
    )
    offset = 0.0 if bench.muscle.name not in SETTINGS else SETTINGS[bench.muscle.name].offset * NORMAL_LITRE
    rng = np.random.default_rng(None if seed is None else [seed, 2025])
    for m in ("1", "2"):
        u, P = (log[f"{name}{m}"].to_numpy(dtype=float) for name in ("u", "P"))
        noise = NOISE * NORMAL_LITRE * rng.standard_normal(len(log))
        log[f"mdot{m}"] = (valve.flow(u, P) + offset + noise).astype(np.float32)

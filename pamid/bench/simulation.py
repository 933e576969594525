"""Run the bench: all runs of one length together, control period by control period."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ..effects import Effect, Signals
from ..effects._places import ROLE
from ..effects.spec import EffectLike, as_effects
from ..errors import DivergedError, ParameterError, TrajectoryError
from .antagonist import Antagonist
from .controller import Controller, RunningController
from .integrate import RungeKutta4
from .parameters import BenchParameters
from .references import PERIOD, Trajectory
from .sensors import SENSORS, Sensor

MAX_BATCH_SAMPLES = 4_000_000
"""Runs times samples simulated together; their records take about 72 bytes each."""


class SensorChain:
    """The faults of one sensor channel, one after the other, moved on once per sample."""

    def __init__(self, channel: str, effects: Sequence[Effect], plant: Any) -> None:
        self.effects = [e for e in effects if e.channel == channel and "measure" in e.hooks()]
        self._role, self._plant = ROLE[channel], plant
        self._memory: list[tuple[Any, Signals]] = []

    def read(self, value: np.ndarray) -> np.ndarray:
        """Return the reading of the true ``value`` at the next sample."""
        if not self.effects:
            return value
        first = not self._memory
        for i, e in enumerate(self.effects):
            s = Signals(**{self._role: np.array(value)})
            if first:
                self._memory.append((e.start(s, self._plant, PERIOD), s))
            else:
                x, before = self._memory[i]
                self._memory[i] = (e.step(x, before, s, PERIOD, self._plant), s)
            value = e.measure(value, self._memory[i][0])
        return value


@dataclass(eq=False)
class Record:
    """What a batch of runs of one length did, time along the first axis and runs along the last.

    ``q``, ``P``, ``F``, ``mdot`` are what faulty but noise-free sensors read; ``y`` and ``dy`` are the true state
    (q, q̇, P₁, P₂) and its rate, None unless asked for; ``params`` is the bench with those effects carried out that only
    change a parameter.
    """

    q: np.ndarray
    P: np.ndarray
    F: np.ndarray
    mdot: np.ndarray
    u: np.ndarray
    y: np.ndarray | None
    dy: np.ndarray | None
    F_true: np.ndarray | None
    mdot_true: np.ndarray | None
    params: BenchParameters


def run_batch(
    params: BenchParameters,
    runs: Sequence[Trajectory],
    effects: Sequence[Effect] = (),
    controller: Controller | None = None,
    substeps: int = 1,
    truth: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Record:
    """Simulate runs of one length, lead-in included."""
    length, n = len(runs[0].q_ref), len(runs)
    everything = [*params.make_effects(), *effects]
    nominal = params.replace(effects=())
    specs = tuple((e.name, e.values) for e in everything if "adjust" in e.hooks())
    actual = nominal.replace(effects=specs).adjusted()
    others = [e for e in everything if "adjust" not in e.hooks()]
    control = RunningController(controller or Controller(), nominal, runs)
    bench = Antagonist(actual, n, others)
    chains = {channel: SensorChain(channel, others, bench.plant) for channel in ROLE}
    faulty = any(chain.effects for chain in chains.values())

    y = np.zeros((4, n))
    y[0] = [run.q_ref[0] for run in runs]
    y[2:] = control.initial_pressure()
    solver = RungeKutta4(bench.rates, y.shape)
    h = PERIOD / substeps
    q, P, F = np.empty((length, n)), np.empty((length, 2, n)), np.empty((length, 2, n))
    mdot, U = np.empty((length, 2, n)), np.empty((length, 2, n))
    Y = np.empty((length, 4, n)) if truth else None
    dY = np.empty((length, 4, n)) if truth else None
    F_true, mdot_true = (np.empty_like(F), np.empty_like(F)) if truth else (None, None)
    muscles, remembers = bench.muscles, False
    held = np.zeros((2, n))
    for k in range(length):
        q_read, P_read = y[0], y[2:]
        if faulty:
            q_read, P_read = chains["q"].read(y[0].copy()), chains["P"].read(y[2:].copy())
        u = control.command(k, q_read, P_read)
        if k == 0:
            muscles.hold(u)
            bench.start_memory(y, PERIOD)
            remembers = bool(muscles.remembering or bench.remembers)
        else:
            muscles.hold(u)
            if remembers:
                muscles.sample_memory(held, PERIOD)
        held = u
        dy = solver.first(y)
        q[k], P[k], U[k] = q_read, P_read, u
        if truth:
            Y[k], dY[k], F_true[k], mdot_true[k] = y, dy, muscles.F, muscles.mdot  # type: ignore[index]
        if faulty:
            F[k], mdot[k] = chains["F"].read(muscles.F.copy()), chains["mdot"].read(muscles.mdot.copy())
        else:
            F[k], mdot[k] = muscles.F, muscles.mdot
        for i in range(substeps):
            if i:
                solver.first(y)
            solver.advance(y, h)
            if remembers:
                bench.carry_memory(y, h)
        if progress is not None and k % 100 == 99:
            progress(100 * n)
    if progress is not None:
        progress(length % 100 * n)
    if not np.all(np.isfinite(y)):
        lost = runs[int(np.argmin(np.isfinite(y).all(0)))].name
        raise DivergedError(
            f"The simulation of {lost} diverged.",
            "motions that the bench can make",
            "Check the amplitudes and the effects' parameters, or raise substeps.",
        )
    return Record(q, P, F, mdot, U, Y, dY, F_true, mdot_true, actual)


def simulate(
    params: BenchParameters,
    trajectories: Sequence[Trajectory],
    *,
    seed: int | None = 0,
    effects: Sequence[EffectLike] = (),
    controller: Controller | None = None,
    sensors: Mapping[str, Sensor] | None = None,
    substeps: int = 1,
    truth: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Any:
    """Simulate the antagonistic bench and return its log.

    All runs advance together; a run's noise depends on the seed and its place in the list alone.

    Parameters
    ----------
    params : BenchParameters
        The bench, with the effects of its simulator file.
    trajectories : sequence of Trajectory
        The runs, each under its own name.
    seed : int, default=0
        Seed of the sensors' noise.
    effects : sequence, default=()
        More effects: objects, names, or pairs (name, parameters).
    controller : Controller, optional
        Settings of the controller.
    sensors : mapping of str to Sensor, optional
        Noise and resolution by channel (``q``, ``P``, ``F``, ``mdot``); a channel left out is taken from `SENSORS`.
    substeps : int, default=1
        Integration steps per control period of 1 ms.
    truth : bool, default=False
        Whether to return the true signals as well.
    progress : callable, optional
        Called with the number of samples done since the last call.

    Returns
    -------
    log : DataFrame
        Columns ``trajectory``, ``time`` (s), ``q_ref``, ``q`` (rad), ``u1``, ``P1`` (Pa, absolute), ``F1`` (N),
        ``mdot1`` (kg/s), and the same for muscle 2; signals in single precision, as a logger writes them.
    true : DataFrame
        Only with ``truth=True``: ``q``, ``dq``, ``ddq`` and for each muscle ``eps``, ``deps``, ``P``, ``dP``, ``V``
        (of the nominal cylinder), ``F``, ``mdot``, row by row as in the log, in double precision.

    Raises
    ------
    TrajectoryError
        There is no run, or two runs share a name.
    DivergedError
        The simulation became infinite.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> log = simulate(BenchParameters.for_muscle("B"), [sine(4, 10, samples=500)], seed=1)
    >>> len(log), log["trajectory"].iloc[0]
    (500, 'sine-4-10')
    """
    names = [run.name for run in trajectories]
    if not names or len(set(names)) < len(names):
        double = sorted({name for name in names if names.count(name) > 1})
        raise TrajectoryError(
            f"The names {', '.join(double)} stand for two runs." if double else "There are no runs.",
            "at least one run, each with a name of its own",
            "Rename repeats, such as sine-1-10-b.",
        )
    if not isinstance(substeps, int) or substeps < 1:
        raise ParameterError(f"substeps is {substeps!r}.", "a whole number from 1", "Use 1 or 2.")
    extra = as_effects(effects)
    fitted = {**SENSORS, **(sensors or {})}
    generators = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(len(names))]
    logs: list[Any] = [None] * len(names)
    truths: list[Any] = [None] * len(names)
    for members in _batches([len(run.q_ref) for run in trajectories]):
        runs = _of_one_length([trajectories[i] for i in members])
        record = run_batch(params, runs, extra, controller, substeps, truth, progress)
        for j, i in enumerate(members):
            logs[i] = _log_of(record, j, trajectories[i], generators[i], fitted)
            if truth:
                truths[i] = _truth_of(record, j, trajectories[i])
    log = pd.concat([pd.DataFrame(part) for part in logs], ignore_index=True)
    if not truth:
        return log
    return log, pd.concat([pd.DataFrame(part) for part in truths], ignore_index=True)


def _batches(lengths: Sequence[int]) -> list[list[int]]:
    """Return which runs to simulate together: as many as the memory of their records allows."""
    batches: list[list[int]] = []
    longest = 0
    for i in sorted(range(len(lengths)), key=lambda i: (-lengths[i], i)):
        if not batches or (len(batches[-1]) + 1) * longest > MAX_BATCH_SAMPLES:
            batches.append([])
            longest = lengths[i]
        batches[-1].append(i)
    return batches


def _of_one_length(runs: Sequence[Trajectory]) -> list[Trajectory]:
    """Return the runs, the shorter ones held at their end; what is added is cut off again."""
    length = max(len(run.q_ref) for run in runs)

    def longer(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else np.pad(values, (0, length - len(values)), mode="edge")

    return [
        run
        if len(run.q_ref) == length
        else replace(
            run,
            q_ref=np.pad(run.q_ref, (0, length - len(run.q_ref)), mode="edge"),
            pressure_offset=longer(run.pressure_offset),
            sealed=longer(run.sealed),
        )
        for run in runs
    ]


def _log_of(
    record: Record, j: int, run: Trajectory, rng: np.random.Generator, sensors: Mapping[str, Sensor]
) -> dict[str, Any]:
    rows = slice(run.lead, len(run.q_ref))
    n = run.n_samples
    columns: dict[str, Any] = {
        "trajectory": np.full(n, run.name, dtype=object),
        "time": np.round(np.arange(n) * PERIOD, 9),
        "q_ref": run.q_ref[rows].astype(np.float32),
        "q": sensors["q"].read(record.q[rows, j], rng).astype(np.float32),
    }
    for m in (0, 1):
        columns[f"u{m + 1}"] = record.u[rows, m, j].astype(np.float32)
        for channel, values in (("P", record.P), ("F", record.F), ("mdot", record.mdot)):
            columns[f"{channel}{m + 1}"] = sensors[channel].read(values[rows, m, j], rng).astype(np.float32)
    return columns


def _truth_of(record: Record, j: int, run: Trajectory) -> dict[str, Any]:
    assert record.y is not None and record.dy is not None
    assert record.F_true is not None and record.mdot_true is not None
    rows = slice(run.lead, len(run.q_ref))
    y, dy = record.y[rows, :, j], record.dy[rows, :, j]
    params, plant = record.params, record.params.plant()
    gain = params.joint.pulley_radius / params.muscle.rest_length
    columns: dict[str, Any] = {
        "trajectory": np.full(run.n_samples, run.name, dtype=object),
        "time": np.round(np.arange(run.n_samples) * PERIOD, 9),
        "q": y[:, 0],
        "dq": y[:, 1],
        "ddq": dy[:, 1],
    }
    for m, sign in ((0, 1.0), (1, -1.0)):
        eps = params.muscle.initial_contraction + sign * gain * y[:, 0]
        columns[f"eps{m + 1}"] = eps
        columns[f"deps{m + 1}"] = sign * gain * y[:, 1]
        columns[f"P{m + 1}"], columns[f"dP{m + 1}"] = y[:, 2 + m], dy[:, 2 + m]
        columns[f"V{m + 1}"] = plant.volume(eps)
        columns[f"F{m + 1}"], columns[f"mdot{m + 1}"] = record.F_true[rows, m, j], record.mdot_true[rows, m, j]
    return columns

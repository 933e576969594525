"""One run of a log as arrays, with the simulator's effects applied: what the equations read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import (
    ColumnTypeError,
    EmptyLogError,
    InterleavedTrajectoryError,
    MissingColumnError,
    MissingTrajectoryError,
    NonFiniteError,
    SamplingError,
    TimeOrderError,
)
from ..laws.valve import valve_flow
from ..signals.paths import play
from .noise import ChannelNoise, channel_noise, noise_beside
from .windows import samples_per_window, span, starts

if TYPE_CHECKING:
    import pandas as pd

    from ..bench.parameters import BenchParameters
    from ..effects import Effect, Plant, Signals, Step

MUSCLES = (1, 2)
SIGNS = np.array([1.0, -1.0])
"""How the joint angle contracts muscles 1 and 2."""
_GAP = 1.5  # in sampling intervals: a longer step of time is a gap, which no window crosses
_JITTER = 0.25  # in sampling intervals
_SETTLING = 0.1  # s: what effects remember from before a log is not known; windows at its ends are left out
_STILL = 0.5  # of the angle's noise, of which a local fit leaves a third: motion within it counts as rest
_REMEMBERED = 8  # memories of paths that are kept for fits to come


class Model:
    """The parameters of a bench with its effects made, as the equations use them.

    Parameters
    ----------
    params : BenchParameters
        The simulator.
    settled : bool, default=False
        Whether the ends of every stretch are left out, as they are for effects with memory, so that simulators with
        and without memory are held against the same windows.
    noise : bool, default=True
        Whether residuals come with their noise; zeros otherwise.
    """

    def __init__(self, params: BenchParameters, settled: bool = False, noise: bool = True) -> None:
        self.settled, self.noise = settled, noise
        self.params = params.adjusted() if params.effects else params
        self.effects: list[Effect] = self.params.make_effects()
        self.plant: Plant = self.params.plant()

    def with_hook(self, hook: str) -> list[Effect]:
        """Return the effects that override a hook."""
        return [effect for effect in self.effects if hook in effect.hooks()]


@dataclass
class Run:
    """Signals of one evenly sampled stretch of a log.

    Parameters
    ----------
    trajectory : str
        Name of the trajectory.
    time : array, shape (n_samples,)
        s.
    dt : float
        Sampling interval, s.
    q : array, shape (n_samples,)
        Joint angle, rad.
    channels : dict of str to array, shape (n_samples, 2)
        The channels ``P``, ``F``, ``mdot``, ``u`` of both muscles, those that the log has.
    model : Model
        The simulator.
    """

    trajectory: str
    time: np.ndarray
    dt: float
    q: np.ndarray
    channels: dict[str, np.ndarray]
    model: Model
    noises: dict[str, list[ChannelNoise]] = field(default_factory=dict)
    responses: dict[str, np.ndarray] = field(default_factory=dict)
    smoothed: dict[tuple[Any, ...], np.ndarray] = field(default_factory=dict)
    memories: dict[tuple[Any, ...], np.ndarray] = field(default_factory=dict)

    def under(self, model: Model) -> Run:
        """Return the same stretch of the log held against another simulator."""
        channels = {name: x for name, x in self.readings.items() if name != "q"}
        other = Run(self.trajectory, self.time, self.dt, self.readings["q"], channels, model, self.noises)
        if not self.model.with_hook("measure") and not model.with_hook("measure"):
            other.smoothed = self.smoothed  # what a filter makes of the same readings is the same
            other.memories = self.memories  # … and what a path leaves in the same bristles
        return other

    def __post_init__(self) -> None:
        self.readings = {"q": self.q, **self.channels}
        self.n = samples_per_window(self.dt)
        faults = self.model.with_hook("measure")
        remembering = any(effect.n_states for effect in self.model.effects)
        rows = round(_SETTLING / self.dt)
        settled = self.model.settled
        self.margins = (
            rows if remembering or settled else 0,
            rows if settled or any(f.n_states for f in faults) else 0,
        )
        start = np.zeros(1, dtype=int)
        for name in ("q", *self.channels):
            series = self.q[:, None] if name == "q" else self.channels[name]
            if name not in self.noises:
                found = [channel_noise(series[:, k], self.n) for k in range(series.shape[1])]
                if name == "mdot" and (drive := self._driven_flow()) is not None:
                    found = [noise_beside(series[:, k], drive[:, k], one) for k, one in enumerate(found)]
                self.noises[name] = found
            self.responses[name] = np.ones(1)
            for effect in faults:
                if effect.channel != name:
                    continue
                series = np.asarray(effect.restore(series, self.dt, start), dtype=float)
                self.responses[name] = np.convolve(self.responses[name], _response(effect, self.dt))
            if name == "q":
                self.q = series[:, 0]
            else:
                self.channels[name] = series

    def _driven_flow(self) -> np.ndarray | None:
        """Return the flow that the commands as read let through the nominal valves, kg/s; None without them."""
        if "u" not in self.readings or "P" not in self.readings:
            return None
        gas, valve = self.model.params.gas, self.model.params.valve
        flow = valve_flow(
            self.readings["u"],
            np.maximum(self.readings["P"], 1.0),
            gas.supply_pressure,
            gas.atmospheric_pressure,
            sonic_conductance=valve.sonic_conductance,
            critical_pressure_ratio=valve.critical_pressure_ratio,
            reference_density=valve.reference_density,
        )
        return np.asarray(flow)

    def starts(self, n_rows: int, order: int, shift: int = 0) -> np.ndarray:
        """Return the first rows of the windows, less those at the ends where effects' memory is not yet known."""
        first = starts(n_rows, self.n, order, shift)
        head, tail = self.margins
        return first[(first >= head) & (first + span(self.n, order) <= n_rows - tail)]

    def weights(self, channel: str, weights: np.ndarray) -> np.ndarray:
        """Return the weights on a channel's readings of weights on its restored values."""
        response = self.responses[channel]
        return weights if len(response) == 1 and response[0] == 1.0 else np.convolve(weights, response)

    def noise(self, channel: str) -> list[ChannelNoise]:
        """Return the noise of a channel, one entry a muscle (one in all for ``"q"``)."""
        return self.noises[channel]

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["channels"][name]
        except KeyError:
            raise AttributeError(name) from None

    @cached_property
    def eps(self) -> np.ndarray:
        """Contraction ratios, shape (n_samples, 2)."""
        p = self.model.params
        gain = p.joint.pulley_radius / p.muscle.rest_length
        return p.muscle.initial_contraction + gain * self.q[:, None] * SIGNS

    @cached_property
    def volume(self) -> np.ndarray:
        """Nominal gas volumes, m³, shape (n_samples, 2)."""
        return np.asarray(self.model.plant.volume(self.eps))

    @cached_property
    def volume_slope(self) -> np.ndarray:
        """∂V/∂ε, m³, shape (n_samples, 2)."""
        return np.asarray(self.model.plant.volume_slope(self.eps))

    # --- effects --------------------------------------------------------------------------------------------
    def smooth(self, channel: str, deriv: int) -> np.ndarray:
        """Smooth or differentiate a channel by a local fit of fourth degree, as effects read it; a column a muscle."""
        key = (channel, deriv)
        if key not in self.smoothed:
            x = self.q[:, None] if channel == "q" else self.channels[channel]
            width = min(2 * self.n + 1, len(x) - (len(x) + 1) % 2)
            if width < 7:
                self.smoothed[key] = np.gradient(x, self.dt, axis=0) if deriv else x
            else:
                self.smoothed[key] = _local_fit(x, width, deriv) / self.dt**deriv
        return self.smoothed[key]

    def still(self) -> np.ndarray:
        """Return the joint angle with its noise taken off: noise is motion to and fro, which memory would believe."""
        key = ("still", 0)
        if key not in self.smoothed:
            self.smoothed[key] = play(self.smooth("q", 0), _STILL * self.noises["q"][0].white)
        return self.smoothed[key]

    def _signals(self, effect: Effect) -> Signals:
        from ..effects import Signals

        roles = set(effect.roles)
        joint = effect.site == "joint"
        position = self.q[:, None] if joint else self.eps
        P = self.channels.get("P")
        s = Signals(time=self.time[:, None], position=position, pressure=P, command=self.channels.get("u"))
        s.flow, s.force = self.channels.get("mdot"), self.channels.get("F")
        p = self.model.params
        turn = np.ones(1) if joint else SIGNS * p.joint.pulley_radius / p.muscle.rest_length
        if "velocity" in roles:
            s.velocity = turn * self.smooth("q", 1)
        if "pressure_rate" in roles and P is not None:
            s.pressure_rate = self.smooth("P", 1)
        if effect.n_states and "position" in roles:
            s.position = (0.0 if joint else p.muscle.initial_contraction) + turn * self.still()
        return s

    @cached_property
    def _traces(self) -> list[tuple[Effect, Signals, Any]]:
        traces = []
        for effect in self.model.effects:
            if set(effect.hooks()) <= {"measure", "adjust"}:
                continue  # undone in the channels and in the parameters already
            signals = self._signals(effect)
            traces.append((effect, signals, self._memory(effect, signals)))
        return traces

    def _memory(self, effect: Effect, signals: Signals) -> np.ndarray:
        """Return an effect's memory along the run; that of a path is kept, since many fits change amplitudes alone."""
        start = np.zeros(1, dtype=int)
        if not effect.path_dependent:
            return effect.trace(signals, self.model.plant, self.dt, start)
        p = self.model.params
        shape = (effect.values[q.name] for q in effect.parameters if not q.linear)
        key = (effect.name, *shape, p.joint.pulley_radius, p.muscle.rest_length, p.muscle.initial_contraction)
        if key not in self.memories:
            if len(self.memories) >= _REMEMBERED:
                self.memories.pop(next(iter(self.memories)))
            self.memories[key] = effect.trace(signals, self.model.plant, self.dt, start)
        return self.memories[key]

    def _having(self, hook: str) -> Iterator[tuple[Effect, Signals, Any]]:
        for effect, signals, memory in self._traces if self.model.effects else ():
            if hook in effect.hooks():
                yield effect, signals, memory

    def added_force(self) -> np.ndarray | float:
        """Return what effects add to the tensions, N."""
        return sum((e.force(s, x, self.model.plant) for e, s, x in self._having("force")), start=0.0)

    def added_stiffness(self) -> np.ndarray | float:
        """Return what a pascal of the pressure readings adds to that, N/Pa; it decides what their noise adds."""
        h, total = 10.0, 0.0
        for e, s, x in self._having("force"):
            if "pressure" in e.roles:
                near, far = (s.with_(pressure=self.P + sign * h) for sign in (-1, 1))
                step = np.asarray(e.force(far, x, self.model.plant)) - np.asarray(e.force(near, x, self.model.plant))
                total = total + step / (2 * h)
        return total

    def added_flow(self) -> np.ndarray | None:
        """Return what effects add to the flow into the muscles between samples, kg/s, shape (n_samples - 1, 2).

        The terms in Ṗ take the change of pressure from sample to sample: averaged over a window, its noise cancels
        but for the ends.
        """
        total = None
        for e, s, x in self._having("flow"):
            part: Step = e.flow(s, x, self.model.plant)
            a, b = (np.broadcast_to(np.asarray(v, dtype=float), self.P.shape) for v in part)
            rate = np.diff(self.P, axis=0) / self.dt
            added = (a[1:] + a[:-1]) / 2 + (b[1:] + b[:-1]) / 2 * rate
            total = added if total is None else total + added
        return total

    def added_capacity(self) -> np.ndarray | float:
        """Return the gas that effects take in with each pascal, kg/Pa; it decides what the pressure's noise adds."""
        return sum((np.asarray(e.flow(s, x, self.model.plant).b) for e, s, x in self._having("flow")), start=0.0)

    def followed_command(self) -> np.ndarray:
        """Return the command that the valves follow."""
        u = self.u
        for e, s, x in self._having("command"):
            u = e.command(u, s, x, self.model.plant)
        return u

    def inlet_pressure(self) -> Any:
        """Return the pressure at the valves' inlets, Pa."""
        P = self.model.params.gas.supply_pressure
        for e, s, x in self._having("supply"):
            P = e.supply(P, s, x, self.model.plant)
        return P

    def added_valve_flow(self) -> np.ndarray | float:
        """Return what effects add to the flow through the valves, kg/s."""
        return sum((e.valve(s, x, self.model.plant) for e, s, x in self._having("valve")), start=0.0)

    def added_torque(self) -> np.ndarray | float:
        """Return what effects add to the torque on the joint, N m."""
        total: Any = 0.0
        for e, s, x in self._having("torque"):
            part = np.asarray(e.torque(s, x, self.model.plant))
            total = total + (part[:, 0] if part.ndim == 2 else part)
        return total


def _local_fit(x: np.ndarray, width: int, deriv: int) -> np.ndarray:
    """Return what `scipy.signal.savgol_filter` does with fourth degree, its weights computed once for all runs."""
    from scipy.ndimage import correlate1d

    half, weights = width // 2, _local_weights(width, deriv)
    out = correlate1d(x, weights[half], axis=0)
    out[:half], out[len(out) - half :] = weights[:half] @ x[:width], weights[half + 1 :] @ x[len(x) - width :]
    return np.asarray(out)


@cache
def _local_weights(width: int, deriv: int) -> np.ndarray:
    """Return the weights with which a window gives the local fit at each of its samples, a row each."""
    from scipy.signal import savgol_coeffs

    return np.stack([savgol_coeffs(width, 4, deriv, pos=k, use="dot") for k in range(width)])


def _response(effect: Effect, dt: float) -> np.ndarray:
    """Return the weights that a sensor fault's `restore` puts on readings, from its answer to an impulse."""
    n = 201
    impulse = np.zeros(n)
    impulse[n // 2] = 1.0
    start = np.zeros(1, dtype=int)
    answer = np.asarray(effect.restore(impulse, dt, start)) - np.asarray(effect.restore(0 * impulse, dt, start))
    used = np.flatnonzero(np.abs(answer) > 1e-9 * np.max(np.abs(answer)))
    return answer[used[0] : used[-1] + 1] if len(used) else np.ones(1)


def columns_of(channel: str) -> list[str]:
    """Return the columns of a log that hold a channel."""
    return [channel] if channel in ("q", "q_ref", "time") else [f"{channel}{m}" for m in MUSCLES]


def _numbers(log: pd.DataFrame, column: str, rows: slice) -> np.ndarray:
    try:
        return log[column].iloc[rows].to_numpy(dtype=float, na_value=np.nan)
    except (TypeError, ValueError):
        bad = next((v for v in log[column].iloc[rows] if isinstance(v, str) or not np.isscalar(v)), "?")
        raise ColumnTypeError(
            f"The column '{column}' holds {str(bad)[:30]!r}.", "numbers", "Remove or convert the entries that are text."
        ) from None


def trajectory_rows(log: pd.DataFrame) -> list[tuple[str, slice]]:
    """Return name and rows of each trajectory of a log, in its order.

    Raises
    ------
    MissingTrajectoryError, InterleavedTrajectoryError, EmptyLogError
        The log does not name its trajectories, mixes their rows, or has none.
    """
    import pandas as pd

    if "trajectory" not in log.columns:
        raise MissingTrajectoryError(
            f"The log has no column 'trajectory'; it has {', '.join(map(str, log.columns[:20]))}.",
            "the name of its run in each row",
            "Add the column, or map one of yours to it.",
        )
    if not len(log):
        raise EmptyLogError("The log has no rows.", "at least one trajectory", "Check how the log was written.")
    codes, names = pd.factorize(log["trajectory"], use_na_sentinel=False)
    borders = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    if len(borders) - 1 != len(names):
        raise InterleavedTrajectoryError(
            f"The log has {len(names)} trajectories in {len(borders) - 1} separate blocks of rows.",
            "the rows of each trajectory together and in time order",
            "Sort the log by trajectory and time; give repeats names of their own.",
        )
    return [(str(names[codes[a]]), slice(a, b)) for a, b in pairwise(borders)]


def runs(log: pd.DataFrame, model: Model, channels: list[str]) -> Iterator[Run]:
    """Cut a log into evenly sampled stretches, one trajectory at a time.

    A stretch ends where a trajectory ends, where time jumps, and where a channel is NaN.

    Parameters
    ----------
    log : DataFrame
        The log, SI units, absolute pressures.
    model : Model
        The simulator.
    channels : list of str
        The channels to read, of ``P``, ``F``, ``mdot``, ``u``; ``q`` is always read.

    Yields
    ------
    Run
        The stretches in order.
    """
    needed = ["time", *columns_of("q"), *(c for name in channels for c in columns_of(name))]
    if missing := [c for c in needed if c not in log.columns]:
        raise MissingColumnError(
            f"The log lacks {', '.join(missing)}.",
            f"the columns {', '.join(needed)}",
            f"Map your columns to these names; the log has {', '.join(map(str, log.columns[:20]))}.",
        )
    for name, rows in trajectory_rows(log):
        time = _numbers(log, "time", rows)
        data = {c: _numbers(log, c, rows) for c in needed[1:]}
        if np.isinf(bad := np.sum(list(data.values()), axis=0)).any():
            column = next(c for c, v in data.items() if np.isinf(v).any())
            raise NonFiniteError(
                f"The column '{column}' of trajectory '{name}' holds infinite values.",
                "finite numbers, or NaN where nothing was measured",
                "Remove those rows or set them to NaN.",
            )
        if not np.isfinite(time).all():
            raise NonFiniteError(
                f"The time of trajectory '{name}' holds NaN.", "a time in each row", "Remove those rows."
            )
        steps = np.diff(time)
        if len(steps) and steps.min() <= 0:
            at = int(np.argmin(steps))
            raise TimeOrderError(
                f"The time of trajectory '{name}' goes from {time[at]:g} s to {time[at + 1]:g} s.",
                "time that increases",
                "Sort the trajectory by time and remove repeated rows; runs of their own need names of their own.",
            )
        if len(time) < 2:
            continue
        dt = float(np.median(steps))
        regular = steps < _GAP * dt
        if np.any(np.abs(steps[regular] - dt) > _JITTER * dt):
            raise SamplingError(
                f"The sampling interval of trajectory '{name}' varies from {steps[regular].min():g} s to "
                f"{steps[regular].max():g} s.",
                f"even sampling (its median is {dt:g} s)",
                "Resample the log onto an even grid first.",
            )
        usable = np.isfinite(bad)
        cuts = np.flatnonzero(~regular | (usable[1:] != usable[:-1])) + 1
        for a, b in zip([0, *cuts.tolist()], [*cuts.tolist(), len(time)], strict=True):
            if usable[a] and b - a > 1:
                pairs = {c: np.column_stack([data[k][a:b] for k in columns_of(c)]) for c in channels}
                yield Run(name, time[a:b], dt, data["q"][a:b], pairs, model)

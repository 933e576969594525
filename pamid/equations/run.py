"""A stretch of a log compared with a simulator, its effects applied: the inputs of the equations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, cached_property
from typing import Any, ClassVar, Protocol

import numpy as np

from ..bench.parameters import BenchParameters
from ..effects import Effect, FlowTerm, Plant, Signals
from ..laws.valve import valve_flow
from ..signals.paths import Path, play
from ..signals.stretches import stretches_of
from .noise import ChannelNoise, channel_noise, noise_beside
from .stretch import BRIDGED, HALF, Stretch, remembered
from .windows import WINDOW, Windows, average, span, starts

MUSCLES = (1, 2)
SIGNS = np.array([1.0, -1.0])
"""How the joint angle contracts muscles 1 and 2."""
_SETTLING = 0.1  # s: what effects remember from before a log is not known; windows at its ends are left out
_SHORT = 4  # … but no more than one part in so many of a short stretch at either end
_LEAST = 0.1  # share of the samples of a window that must be there
_STILL = 0.5  # of the angle's noise, of which a local fit leaves a third: motion within it counts as rest


class Tested(Protocol):
    """What a run reads of an equation: the order of its test functions, its channels and sides."""

    order: ClassVar[int]
    channels: ClassVar[tuple[str, ...]]
    sides: ClassVar[tuple[str, ...]]


def through_valves(params: BenchParameters, u: Any, P: Any, inlet: Any) -> np.ndarray:
    """Return the flow that the nominal valves let through at commands, at pressures behind and before them, kg/s."""
    valve = params.valve
    flow = valve_flow(
        u,
        P,
        inlet,
        params.gas.atmospheric_pressure,
        sonic_conductance=valve.sonic_conductance,
        critical_pressure_ratio=valve.critical_pressure_ratio,
        reference_density=valve.reference_density,
    )
    return np.asarray(flow)


class Model:
    """The parameters of a bench with its effects; `settled` leaves out the ends of stretches, `noise` adds noise."""

    def __init__(self, params: BenchParameters, settled: bool = False, noise: bool = True) -> None:
        self.settled, self.noise = settled, noise
        self.params = params.adjusted() if params.effects else params
        self.effects: list[Effect] = self.params.make_effects()
        self.plant: Plant = self.params.plant()


class Run:
    """Signals of one stretch of a log compared with a simulator."""

    def __init__(self, stretch: Stretch, model: Model) -> None:
        self.stretch, self.model = stretch, model
        self.trajectory, self.time, self.dt, self.n = stretch.trajectory, stretch.time, stretch.dt, stretch.n
        self.channels = {name: x for name, x in stretch.readings.items() if name != "q"}
        self.q = stretch.readings["q"][:, 0]
        faults = [effect for effect in model.effects if "measure" in effect.hooks()]
        # What a filter makes of the same readings is the same, and what a path leaves in the same bristles.
        self.smoothed = {} if faults else stretch.smoothed
        self.memories = remembered() if faults else stretch.memories
        self.paths = remembered() if faults else stretch.paths
        self.signals = remembered() if faults else stretch.signals
        remembering = any(effect.n_states for effect in model.effects)
        # A short stretch keeps most of its rows, and room for a window of each order.
        room = max(len(self.time) - 4 * self.n - 2, 0) // 2
        rows = min(round(_SETTLING / self.dt), len(self.time) // _SHORT, room)
        self.margins = (
            rows if remembering or model.settled else 0,
            rows if model.settled or any(f.n_states for f in faults) else 0,
        )
        if not stretch.noises:
            stretch.noises.update({name: self._noise(name) for name in stretch.readings})
        self.geometry = remembered() if faults else stretch.geometry
        faulty = {fault.channel for fault in faults} & set(stretch.readings)
        self.responses = {name: self._restored(name, faults) for name in faulty}
        self.remembered = {fault.channel for fault in faults if fault.n_states}  # undone to within a sample

    @property
    def starts(self) -> np.ndarray:
        """First row of each stretch that it holds: one, at its beginning."""
        return np.zeros(1, dtype=int)

    def under(self, model: Model) -> Run:
        """Return the same stretch of the log compared with another simulator."""
        return Run(self.stretch, model)

    def _noise(self, name: str) -> list[ChannelNoise]:
        """Return the noise of each column of a channel."""
        series, bridges = self.stretch.readings[name], self.stretch.bridges.get(name)
        if name == "u":  # what was commanded is known; only between samples it is not
            return [ChannelNoise(0.0, 0.0, 0.0)] * series.shape[1]
        drive = self._driven_flow() if name == "mdot" else None
        found = []
        for k in range(series.shape[1]):
            at, x = (None, series[:, k]) if bridges is None else (bridges[k].at, bridges[k].samples)
            noise = channel_noise(x, self.n, at)
            if drive is not None:
                cause = drive[:, k] if at is None else np.interp(at, np.arange(len(drive)), drive[:, k])
                noise = noise_beside(x, cause, noise, at)
            found.append(noise)
        return found

    def _restored(self, name: str, faults: list[Effect]) -> np.ndarray:
        """Undo the faults of a channel's sensor; return the weights of readings in a restored value."""
        series, response = self.stretch.readings[name], np.ones(1)
        for effect in faults:
            if effect.channel == name:
                series = np.asarray(effect.restore(series, self.dt, self.starts), dtype=float)
                if self.model.noise:
                    response = np.convolve(response, _response(effect, self.dt))
        if name == "q":
            self.q = series[:, 0]
        else:
            self.channels[name] = series
        return response

    def _driven_flow(self) -> np.ndarray | None:
        """Return the flow that the commands as read let through the nominal valves, kg/s; None without them."""
        readings = self.stretch.readings
        if "u" not in readings or "P" not in readings:
            return None
        params = self.model.params
        return through_valves(params, readings["u"], np.maximum(readings["P"], 1.0), params.gas.supply_pressure)

    def windows(self, equation: Tested) -> Windows:
        """Return the windows in which an equation is tested: those of which enough is known."""
        key = (equation.order, *equation.channels, *self.margins)
        found = self.stretch.selections.get(key)
        if found is None:
            found = self.stretch.selections[key] = self._windows(equation)
        return found

    def _windows(self, equation: Tested) -> Windows:
        order, stretch, (head, tail) = equation.order, self.stretch, self.margins
        n_rows, pad = len(self.time), order - 1
        first = starts(n_rows - pad, self.n, order, shift=-(pad // 2))
        # What effects remember from before a stretch, or take from behind it, is not known.
        first = first[(first >= head) & (first + span(self.n, order) <= n_rows - pad - tail)]
        partial = [c for c in equation.channels if c in stretch.bridges]
        if not partial or not len(first):
            return Windows(self.n, order, first, n_rows)
        unknown = np.zeros(n_rows, dtype=bool)
        for channel in partial:
            unknown |= _widened(stretch.holes(channel, BRIDGED), head, tail)
            unknown |= stretch.torn(channel)
            if order > 1:
                unknown |= stretch.holes(channel, HALF * WINDOW)
        before = np.concatenate([[0], np.cumsum(unknown)])
        first = first[before[first + span(self.n, order) + pad] == before[first]]
        if order > 1:
            return Windows(self.n, order, first, n_rows)
        given = np.ones((n_rows, len(equation.sides)), dtype=bool)
        for channel in partial:
            given &= np.column_stack([bridge.given for bridge in stretch.bridges[channel]])
        share = average(given.astype(float), self.n, order, first)
        return Windows(self.n, order, first[(share >= _LEAST).all(axis=1)], n_rows, given)

    def covariances(self, windows: Windows, channel: str, weights: np.ndarray) -> np.ndarray:
        """Return a channel's noise in weighted sums of its restored values, see `Windows.covariances`."""
        response, bridges = self.responses.get(channel), self.stretch.bridges.get(channel)
        if response is not None and (len(response) > 1 or response[0] != 1.0):
            weights = np.convolve(weights, response)
        return windows.covariances(channel, weights, self.stretch.noises[channel], bridges)

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["channels"][name]
        except KeyError:
            raise AttributeError(name) from None

    def reads(self, equation: Tested) -> bool:
        """Return whether the stretch has all channels of an equation."""
        return all(channel == "q" or channel in self.channels for channel in equation.channels)

    @cached_property
    def eps(self) -> np.ndarray:
        """Contraction ratios, shape (n_samples, 2)."""
        p = self.model.params
        gain, first = p.joint.pulley_radius / p.muscle.rest_length, p.muscle.initial_contraction
        return self.kept(("eps", gain, first), lambda: first + gain * self.q[:, None] * SIGNS)

    @cached_property
    def state(self) -> dict[str, np.ndarray]:
        """Angle, contractions, pressures and commands with their smoothed rates, of shape (n_samples, 1 or 2)."""
        p = self.model.params
        found = {"q": self.q[:, None], "dq": self.smooth("q", 1), "eps": self.eps}
        found["deps"] = found["dq"] * (SIGNS * p.joint.pulley_radius / p.muscle.rest_length)
        if "P" in self.channels:
            found["P"], found["dP"] = self.channels["P"], self.smooth("P", 1)
        if "u" in self.channels:
            found["u"] = self.channels["u"]
        return found

    @cached_property
    def volume(self) -> np.ndarray:
        """Nominal gas volumes, m³, shape (n_samples, 2)."""
        return self.kept(("volume", *self.shape), lambda: np.asarray(self.model.plant.volume(self.eps)))

    @cached_property
    def volume_slope(self) -> np.ndarray:
        """∂V/∂ε, m³, shape (n_samples, 2)."""
        return self.kept(("slope", *self.shape), lambda: np.asarray(self.model.plant.volume_slope(self.eps)))

    @property
    def shape(self) -> tuple[float, ...]:
        """What the volume depends on."""
        p, plant = self.model.params, self.model.plant
        first, radius = p.muscle.initial_contraction, p.joint.pulley_radius
        return plant.rest_length, plant.thread_length, plant.turns, first, radius, p.muscle.rest_length

    def kept(self, key: tuple[Any, ...], make: Callable[[], np.ndarray]) -> np.ndarray:
        """Return the readings under nominal parameters, computed once for all simulators that share them."""
        return self.geometry.get(key, make)

    # --- effects --------------------------------------------------------------------------------------------
    def smooth(self, channel: str, deriv: int) -> np.ndarray:
        """Smooth or differentiate a channel by local quartic fits, as effects read it; a column per muscle."""
        key = (channel, deriv)
        if key not in self.smoothed:
            self.smoothed[key] = self._smoothed(self.q[:, None] if channel == "q" else self.channels[channel], deriv)
        return self.smoothed[key]

    def _smoothed(self, x: np.ndarray, deriv: int) -> np.ndarray:
        width = min(2 * self.n + 1, len(x) - (len(x) + 1) % 2)
        if width < 7:
            return np.gradient(x, self.dt, axis=0) if deriv else x
        return _local_fit(x, width, deriv) / self.dt**deriv

    def still(self) -> np.ndarray:
        """Return the joint angle without its noise, which effects with memory would take for motion."""
        key = ("still", 0)
        if key not in self.smoothed:
            self.smoothed[key] = self._played(self.smooth("q", 0))
        return self.smoothed[key]

    def _played(self, x: np.ndarray) -> np.ndarray:
        return play(x, _STILL * self.stretch.noises["q"][0].white)

    def _signals(self, effect: Effect) -> Signals:
        """Return the signals that an effect reads, computed once for all that read the same."""
        p = self.model.params
        geometry = p.joint.pulley_radius, p.muscle.rest_length, p.muscle.initial_contraction
        key = (effect.site, *effect.roles, effect.n_states > 0, *geometry)
        return self.signals.get(key, lambda: self._made_signals(effect))

    def _made_signals(self, effect: Effect) -> Signals:
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
        if not effect.path_dependent:
            return effect.trace(signals, self.model.plant, self.dt, self.starts)
        p = self.model.params
        shape = (effect.values[q.name] for q in effect.parameters if not q.linear)
        key = (effect.name, *shape, p.joint.pulley_radius, p.muscle.rest_length, p.muscle.initial_contraction)
        return self.memories.get(
            key, lambda: effect.trace_along(self._path(effect, signals), self.model.plant, self.dt)
        )

    def _path(self, effect: Effect, signals: Signals) -> Path:
        """Return the path that an effect remembers, made once for all effects of a muscle, or of the joint."""
        p = self.model.params
        key = (effect.site, p.joint.pulley_radius, p.muscle.rest_length, p.muscle.initial_contraction)
        return self.paths.get(key, lambda: Path(signals.position, self.starts))

    def _having(self, hook: str) -> Iterator[tuple[Effect, Signals, Any]]:
        for effect, signals, memory in self._traces if self.model.effects else ():
            if hook in effect.hooks():
                yield effect, signals, memory

    def added_force(self) -> np.ndarray | None:
        """Return the sum of the effects in the tensions, N, or None."""
        parts = [e.force(s, x, self.model.plant) for e, s, x in self._having("force")]
        return np.asarray(sum(parts)) if parts else None

    def added_force_of_speed(self) -> np.ndarray | float:
        """Return the tension, N, of the motion that smoothing removes from the speed, to first order."""
        total: Any = 0.0
        for e, s, x in self._having("force"):
            if "velocity" in e.roles:
                left = _differences(self.eps, self.dt, self.starts) - s.velocity
                h = max(float(np.std(left)), 1e-12)
                near, far = (e.force(s.with_(velocity=s.velocity + sign * h), x, self.model.plant) for sign in (-1, 1))
                total = total + (np.asarray(far) - np.asarray(near)) / (2 * h) * left
        return total

    def added_stiffness(self) -> np.ndarray | float:
        """Return the derivative of that by the pressure readings, N/Pa, which propagates their noise."""
        h, total = 10.0, 0.0
        for e, s, x in self._having("force"):
            if "pressure" in e.roles:
                near, far = (s.with_(pressure=self.P + sign * h) for sign in (-1, 1))
                step = np.asarray(e.force(far, x, self.model.plant)) - np.asarray(e.force(near, x, self.model.plant))
                total = total + step / (2 * h)
        return total

    def added_flow(self) -> np.ndarray | None:
        """Return the flow that effects add between samples, kg/s, shape (n_samples - 1, 2)."""
        total = None
        for e, s, x in self._having("flow"):
            part: FlowTerm = e.flow(s, x, self.model.plant)
            a, b = (np.broadcast_to(np.asarray(v, dtype=float), self.P.shape) for v in part)
            rate = np.diff(self.P, axis=0) / self.dt
            added = (a[1:] + a[:-1]) / 2 + (b[1:] + b[:-1]) / 2 * rate
            total = added if total is None else total + added
        return total

    def added_capacity(self) -> np.ndarray | float:
        """Return the gas that effects take in per pascal, kg/Pa, which propagates the pressure's noise."""
        return sum((np.asarray(e.flow(s, x, self.model.plant).b) for e, s, x in self._having("flow")), start=0.0)

    def followed_command(self) -> np.ndarray:
        """Return the command that the valves follow."""
        u = self.u
        for e, s, x in self._having("command"):
            u = e.command(u, s, x, self.model.plant)
        return u

    def follows_gradually(self) -> bool:
        """Return whether the command that the valves follow changes between two samples."""
        return any(e.n_states and not e.sampled for e, _, _ in self._having("command"))

    def inlet_pressure(self) -> Any:
        """Return the pressure at the valves' inlets, Pa."""
        P = self.model.params.gas.supply_pressure
        for e, s, x in self._having("supply"):
            P = e.supply(P, s, x, self.model.plant)
        return P

    def added_valve_flow(self) -> np.ndarray | float:
        """Return the sum of the effects in the flow through the valves, kg/s."""
        return sum((e.valve(s, x, self.model.plant) for e, s, x in self._having("valve")), start=0.0)

    def added_torque(self) -> np.ndarray | float:
        """Return the sum of the effects in the torque on the joint, N m."""
        total: Any = 0.0
        for e, s, x in self._having("torque"):
            part = np.asarray(e.torque(s, x, self.model.plant))
            total = total + (part[:, 0] if part.ndim == 2 else part)
        return total


def _differences(x: np.ndarray, dt: float, starts: np.ndarray) -> np.ndarray:
    """Return central differences, 0 at both ends of stretches, which no test function of an acceleration reaches."""
    out = np.zeros_like(x)
    out[1:-1] = (x[2:] - x[:-2]) / (2 * dt)
    out[starts], out[starts - 1] = 0.0, 0.0
    return out


def _local_fit(x: np.ndarray, width: int, deriv: int) -> np.ndarray:
    """Return `scipy.signal.savgol_filter` of fourth degree, its weights computed once for all runs."""
    from scipy.ndimage import correlate1d

    half, weights = width // 2, _local_weights(width, deriv)
    out = correlate1d(x, weights[half], axis=0)
    out[:half], out[len(out) - half :] = weights[:half] @ x[:width], weights[half + 1 :] @ x[len(x) - width :]
    return np.asarray(out)


@cache
def _local_weights(width: int, deriv: int) -> np.ndarray:
    """Return the weights with which a window gives the local fit at each of its samples, a row each."""
    # Scaled to the window, the powers stay of one size; a row of the inverse gives one coefficient at the middle.
    half = (width - 1) / 2
    powers = np.linalg.pinv(np.vander((np.arange(width) - half) / half, 5, increasing=True))
    at = (np.arange(width)[:, None] - half) / half
    derivatives = np.array([np.prod(np.arange(k, k - deriv, -1.0)) for k in range(5)])  # k (k - 1) ...
    basis = derivatives * at ** np.maximum(np.arange(5) - deriv, 0)
    return np.asarray(basis @ powers / half**deriv)


def _response(effect: Effect, dt: float) -> np.ndarray:
    """Return the weights that a sensor fault's `restore` puts on readings, from its answer to an impulse."""
    n = 201
    impulse = np.zeros(n)
    impulse[n // 2] = 1.0
    start = np.zeros(1, dtype=int)
    answer = np.asarray(effect.restore(impulse, dt, start)) - np.asarray(effect.restore(0 * impulse, dt, start))
    used = np.flatnonzero(np.abs(answer) > 1e-9 * np.max(np.abs(answer)))
    return answer[used[0] : used[-1] + 1] if len(used) else np.ones(1)


def _widened(rows: np.ndarray, head: int, tail: int) -> np.ndarray:
    """Return rows with those up to ``head`` after and ``tail`` before any of them."""
    out = rows.copy()
    for a, b in stretches_of(rows):
        out[max(a - tail, 0) : b + head] = True
    return out

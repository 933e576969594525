"""A log compared with a simulator, as one vector of windows: the data of every part of a diagnosis."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
import pandas as pd

from ...bench.parameters import BenchParameters
from ...effects import Effect, Parameter, Plant, all_effects
from ...equations.allowed import CHANNELS, allowed_equations, window_residual, without_windows
from ...equations.base import Equation, Residual
from ...equations.joined import joined
from ...equations.log import BenchLog, columns_of
from ...equations.run import Model, Run
from ...equations.stretch import pool_noise
from ...remembered import Remembered
from ...signals.state import ROLES
from ..settings import LEAST_GAIN, OTHER_SYSTEMS
from .beginnings import without_beginnings
from .protocol import STATE, Spec, lanes
from .settled import Settled
from .whitening import Whitening

RECENT, FEW = 24, 6
"""Residuals under effects that are kept, the last ones asked for; tangents and noises."""


class Evidence(Settled):
    """Residuals of the bench's equations on a log under changed simulators: a `ResidualSource`."""

    exact = True
    overlap = 3
    lasting = ("rest_length", "rest_diameter", "braid_angle", "initial_contraction", "pulley_radius", "inertia")
    """Lengths, angles and masses; valves, friction and gas may change from day to day."""
    bends = False
    """Whether a gain or a length is just that; any other model may be wrong in several small ways at once."""
    rough = simulates = False
    least_gain = LEAST_GAIN
    """Gain in log-likelihood that a first effect must bring at least; noise alone rarely brings one."""
    decisive = LEAST_GAIN
    """Gain that needs no draws to be believed: few windows, such as those of steps, may hold it."""
    fine = 15
    """Samples in a window above which what happens between two samples does not show as a slow error."""
    coarse = 1.5 * LEAST_GAIN, 3.0 * OTHER_SYSTEMS
    """The same gains where windows hold fewer; their noise is then taken as it is."""
    curved = one_sided = False
    """Tolerances are so narrow that parameters act linearly."""
    pace = 1.0
    twins: Mapping[str, str] = MappingProxyType({})
    stretch = 0.3
    """Length of the stretches of time that are drawn as a whole, s: longer than what residuals remember."""

    def __init__(self, log: pd.DataFrame | BenchLog, params: BenchParameters) -> None:
        log = BenchLog.of(log)
        self.params, self.effects = params, dict(all_effects())
        allowed, self.skipped = allowed_equations(log)
        self._equations: dict[str, Equation] = allowed
        channels = [c for c in CHANNELS if log.holds(c)]
        self.columns = [column for c in CHANNELS for column in columns_of(c) if log.reads(column)]
        self.runs: list[Run] = list(log.runs(Model(params, settled=True), channels))
        self.rows = sum(len(run.time) for run in self.runs)
        pool_noise([run.stretch for run in self.runs])
        self.trajectories = list(dict.fromkeys(run.trajectory for run in self.runs))
        self.equations: list[str] = []
        self.parts: list[slice] = []
        self.units = {name: equation.unit for name, equation in allowed.items()}
        self._slots: dict[str, list[tuple[int, slice]]] = {}
        pieces: list[tuple[np.ndarray, ...]] = []
        shared: dict[str, list[list[np.ndarray]]] = {}
        n = 0
        for name, equation in allowed.items():
            first, slots = n, []
            for i, run in enumerate(self.runs):
                residual = window_residual(equation, run)
                if residual is None:
                    continue
                pieces.append(self._piece(i, residual))
                shared.setdefault(name, []).append([lag.ravel() for lag in residual.shared])
                slots.append((i, slice(n, n + residual.value.size)))
                n += residual.value.size
            if n > first:
                self.equations.append(name)
                self.parts.append(slice(first, n))
                self._slots[name] = slots
            else:
                self.skipped[name] = without_windows(equation)
        if not pieces:
            pieces.append(tuple(np.zeros(0) for _ in range(6)))
        value, noise, self.run, self.side, self.time, self.measured = (
            np.concatenate(p) for p in zip(*pieces, strict=True)
        )
        self.run, self.side = self.run.astype(int), self.side.astype(int)
        self.noise = np.maximum(noise, _smallest(value, noise, self.parts))
        self._joined = list(joined(self.runs, Model(params, settled=True, noise=False)))
        self._known = self.noise == noise
        self._raw0 = value / self.noise
        coarse = any(run.n < self.fine for run in self.runs)
        if coarse:
            self.least_gain, self.decisive = self.coarse
        self._whitening = self._white({} if coarse else shared)
        self.z0 = self._whitening.white(self._raw0)
        names = {name: k for k, name in enumerate(self.trajectories)}
        self.block = np.array([names[run.trajectory] for run in self.runs], dtype=int)[self.run]
        self.free = [name for name, t in params.tolerance.items() if t > 0 and params.get(name) != 0]
        self.J = self._tolerances()
        self.weights = np.ones(len(self.parts))
        # A derivative does not resolve a jump of a command between samples: few windows may be far out there.
        self.sharp = [part for e, part in zip(self.equations, self.parts, strict=True) if allowed[e].order == 1]
        self._state: dict[str, np.ndarray] | None = None
        self._tangents, self._spreads, self._recent = (Remembered[np.ndarray](n) for n in (FEW, FEW, RECENT))

    def prior(self, name: str) -> float:
        """Return the logarithm of the odds with which an effect is expected on a bench."""
        effect = self.effects[name]
        return float(effect.prior if "bench" in effect.kinds else min(effect.prior, -OTHER_SYSTEMS))

    @property
    def about(self) -> np.ndarray:
        """Starting deviations of the free parameters, in tolerances: the simulator as given."""
        return np.zeros(len(self.free))

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and highest deviations of the free parameters."""
        return np.full(len(self.free), -1.0), np.ones(len(self.free))

    @property
    def nuisances(self) -> np.ndarray:
        """Change of the residuals by clocks and offsets that are not free: none."""
        return np.zeros((len(self.z0), 0))

    def has(self, name: str) -> bool:
        """Return whether an effect has something to act on here."""
        return True

    def also_under(self, names: Mapping[str, str]) -> None:
        """Add other names of effects, each with that of the library."""
        self.effects |= {other: self.effects[name] for other, name in names.items()}

    def slopes(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return the change of the residuals by one tolerance of each free parameter."""
        return self.J

    def folded(self, spec: Spec, x: np.ndarray) -> tuple[dict[str, dict[str, float]], np.ndarray]:
        """Return the same: a bench's effects have parameters of their own."""
        return {name: dict(values) for name, values in spec.items()}, x

    @staticmethod
    def _piece(i: int, residual: Residual) -> tuple[np.ndarray, ...]:
        m, sides = residual.value.shape
        return (
            residual.value.ravel(),
            residual.noise.ravel(),
            np.full(m * sides, i),
            np.tile(np.arange(sides), m),
            np.repeat(residual.time, sides),
            residual.measured.ravel(),
        )

    def _white(self, shared: Mapping[str, Sequence[Sequence[np.ndarray]]]) -> Whitening:
        """Return the whitening of the noise, from the covariances of neighbouring windows of each run."""
        found = Whitening()
        for name, part in zip(self.equations, self.parts, strict=True):
            if name not in shared:
                continue
            noise, step = self.noise[part], len(self._equations[name].sides)
            correlations = []
            for lag, covariances in enumerate(zip(*shared[name], strict=True), start=1):
                later = np.append(noise[step * lag :], np.ones(min(step * lag, len(noise))))
                correlations.append(np.concatenate(covariances) / (noise * later))
            found.add(part, correlations, step)
        return found

    def change(self, spec: Spec, about: Spec, x: np.ndarray) -> np.ndarray:
        """Return by how much the residuals change from effects to others, at deviations x."""
        return self.tangent(spec, x) - self.tangent(about, x)

    def _tolerances(self) -> np.ndarray:
        columns = []
        for name in self.free:
            step = self.params.tolerance[name]
            columns.append(self.z({}, {name: 1.0}, equations=None) - self.z0 if step else np.zeros(len(self.z0)))
        return np.column_stack(columns) if columns else np.zeros((len(self.z0), 0))

    def deviated(self, deviations: Mapping[str, float]) -> BenchParameters:
        """Return the simulator with parameters changed by multiples of their tolerances."""
        p = self.params
        return p.replace(**{k: p.get(k) * (1.0 + p.tolerance[k] * v) for k, v in deviations.items()})

    def corrected(self, spec: Spec, deviations: Mapping[str, float] | None = None) -> BenchParameters:
        """Return the simulator with effects added and parameters changed by multiples of their tolerances."""
        params = self.deviated(deviations or {})
        return params.replace(effects=(*params.effects, *(self.effects[name](**v) for name, v in spec.items())))

    def touched(self, names: Collection[str]) -> list[str]:
        """Return the equations that effects change."""
        return [e for e in self.equations if any(self._equations[e].changed_by(self.effects[n]) for n in names)]

    def reads(self, channel: str) -> bool:
        """Return whether an equation that is tested reads a channel."""
        return any(channel in self._equations[e].channels for e in self.equations)

    def z(
        self, spec: Spec, deviations: Mapping[str, float] | None = None, equations: Sequence[str] | None = ()
    ) -> np.ndarray:
        """Return the residuals under a changed simulator, in units of the noise and white."""
        wanted = self.equations if equations is None else (list(equations) or self.touched(spec))
        model = Model(self.corrected(spec, deviations), settled=True, noise=False)
        out = np.empty(len(self.noise)) if equations is None else self._raw0.copy()
        for slot, residual in self._residuals(model, wanted):
            out[slot] = residual.value.ravel() / self.noise[slot]
        return self._whitening.white(out)

    def _residuals(self, model: Model, equations: Sequence[str]) -> Iterator[tuple[slice, Residual]]:
        own: list[tuple[Run, range]] = [(run, range(i, i + 1)) for i, run in enumerate(self.runs)]
        for whole, places in own if model.noise else self._joined:
            run = whole.under(model)
            for name in equations:
                slots = [slot for i, slot in self._slots[name] if i in places]
                if not slots:
                    continue
                with np.errstate(all="ignore"):  # a lag undone may leave a pressure below zero: its fit is then poor
                    residual = self._equations[name].residual(run)
                yield slice(slots[0].start, slots[-1].stop), residual

    def tangent(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return z0 such that z0 + ``J x`` equals the exact residuals at deviations x, a tangent of the model there."""
        deviations = dict(zip(self.free, map(float, x), strict=True))
        key = np.asarray(x, dtype=float).tobytes()

        def bare() -> np.ndarray:
            return (self.z({}, deviations, equations=None) if np.any(x) else self.z0) - self.J @ x

        def made() -> np.ndarray:
            out, changed, linear = self._tangents.get(key, bare).copy(), self.z(spec, deviations), self.J @ x
            for name in self.touched(spec):
                part = self.parts[self.equations.index(name)]
                out[part] = changed[part] - linear[part]
                if columns := self._beginnings(spec, name):
                    # The change by tolerances is kept, its tangent is not.
                    kept = without_beginnings(changed[part], columns, self._lanes[part])[0]
                    out[part] = kept - linear[part]
            out.flags.writeable = False
            return out

        # Derivatives with respect to each parameter start from the same effects, which recur.
        return self._recent.get((repr(spec), key), made) if spec else self._tangents.get(key, bare)

    def glance(self, spec: Spec) -> np.ndarray:
        """Return what effects change in the residuals."""
        return self.change(spec, {}, np.zeros(len(self.free)))

    def pieces(self) -> tuple[np.ndarray, int]:
        """Return the run of each window, which is left out as a whole, and how many there are."""
        return self.block, len(self.trajectories)

    def freedom(self, spec: Spec) -> float:
        """Return the price of unknown initial memory of runs, a logarithm of likelihood."""
        total = 0.0
        for name, part, weight in zip(self.equations, self.parts, self.weights, strict=True):
            if columns := self._beginnings(spec, name):
                zero = np.zeros(part.stop - part.start)
                total += float(weight) * without_beginnings(zero, columns, self._lanes[part])[1]
        return total

    def _beginnings(self, spec: Spec, equation: str) -> list[np.ndarray]:
        """Return the whitened contribution of each unknown initial memory to an equation, per standard deviation."""
        part, found = self.parts[self.equations.index(equation)], []
        for name, values in spec.items():
            kind = self.effects[name]
            if kind.beginnings is Effect.beginnings:  # most effects have no memory, and this is called often
                continue
            effect = kind(**values)
            for where, tau, size in effect.beginnings(self._spans, self._plant):
                if where == equation:
                    column = np.zeros(len(self.noise))
                    column[part] = size / self.noise[part] * np.exp(-self.time[part] / tau)
                    found.append(self.white(column)[part])
        return found

    @cached_property
    def _lanes(self) -> np.ndarray:
        """The run and side of each window, from 0 on in each equation."""
        out, every = np.zeros(len(self.run), dtype=int), lanes(self)
        for part in self.parts:
            out[part] = np.unique(every[part], return_inverse=True)[1]
        return out

    @cached_property
    def _spans(self) -> dict[str, float]:
        """Ranges of the signals of the state, by role."""
        found = {ROLES[name]: self.state[name] for name in ("eps", "P")}
        return {role: float(np.nanmax(x) - np.nanmin(x)) for role, x in found.items() if np.any(np.isfinite(x))}

    @cached_property
    def _plant(self) -> Plant:
        return Model(self.params).plant

    def reached(self, p: Parameter) -> Parameter:
        """Return a limit of the valves' command within the range of the command: beyond, it does nothing."""
        if not (p.idle and p.unit == "-" and self.reads("u")):
            return p
        top = max(float(np.nanmax(np.abs(run.u), initial=0.0)) for run in self.runs)
        upper = min(p.upper, top)
        return replace(p, upper=upper, nominal=min(p.nominal, 0.6 * upper)) if p.lower < 0.6 * upper else p

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return by how much undoing the lags of sensors widens each window's noise; None without such effects."""
        lags = {name: values for name, values in spec.items() if self.effects[name].filters_readings()}
        if not lags:
            return None
        return self._spreads.get(repr(lags), lambda: np.maximum(self._noise_under(self.corrected(lags)), 1.0))

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return each window's noise as a share of the nominal simulator's; lags are left to `widening`."""
        instant = {name: values for name, values in spec.items() if not self.effects[name].filters_readings()}
        deviations = dict(zip(self.free, map(float, x), strict=True))
        key = f"{instant!r} {np.asarray(x, dtype=float).tobytes()!r}"
        return self._spreads.get(key, lambda: self._noise_under(self.corrected(instant, deviations)))

    def _noise_under(self, params: BenchParameters) -> np.ndarray:
        """Return the noise of each window under a simulator, as a share of the nominal one's."""
        noise = self.noise.copy()
        for slot, residual in self._residuals(Model(params, settled=True), self.equations):
            noise[slot] = residual.noise.ravel()
        return np.where(self._known, noise / self.noise, 1.0)

    @staticmethod
    def column(name: str, side: int = 0) -> str:
        """Return the column of `pamid.gap.state_table` with a signal of the state of a muscle, the first by default."""
        return name if name in ("q", "dq") else f"{name}{side + 1}"

    def told(self, equation: str) -> dict[str, np.ndarray]:
        """Return what tells a reader where the windows of an equation lie, by the names of the first muscle."""
        return {self.column(name): values for name, values in self.state.items()}

    @property
    def state(self) -> dict[str, np.ndarray]:
        """The state at each window, by the names of `STATE`; NaN where it has none."""
        if self._state is None:
            self._state = {name: np.full(len(self.z0), np.nan) for name in STATE}
            for name in self.equations:
                for i, slot in self._slots[name]:
                    for key, series in self.runs[i].state.items():
                        at = np.searchsorted(self.runs[i].time, self.time[slot]).clip(0, len(series) - 1)
                        column = np.minimum(self.side[slot], series.shape[1] - 1)
                        self._state[key][slot] = series[at, column]
        return self._state


def _smallest(value: np.ndarray, noise: np.ndarray, parts: Sequence[slice]) -> np.ndarray:
    """Return the least noise of each window: a channel without noise would decide everything alone."""
    least = np.zeros(len(value))
    for part in parts:
        known = noise[part][noise[part] > 0]
        size = float(np.sqrt(np.mean(np.square(value[part])))) if len(value[part]) else 0.0
        typical = float(np.median(known)) if len(known) else 0.0
        least[part] = max(0.2 * typical, 1e-6 * size, 1e-150)  # whose square does not overflow
    return least

"""The noise of each window: of readings, of measured inputs, and of what repeated runs show."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..inference.student_t import RobustFit, solve
from ..settings import EXCESS, FALSE_ALARM, FEWEST, LEAST_GAIN
from .between_rows import timed
from .coarse import noisy_copies
from .jumps import NOTE, jumps, off_rows, unknown_instants
from .lasting_noise import Octaves, lasting, likeliest, memories, waves
from .measured_inputs import (
    exceeds,
    quieter,
    relative,
    rough_inputs,
    rounded_off,
    roundings,
    shown,
    white_over,
    without_slow,
)
from .repeats import repeating
from .tolerances import Tolerances, rms
from .whitening import Whitening, memory_of, smoothed

if TYPE_CHECKING:
    from ..inference.gauss_newton import Fit

REPLICATES = 6
"""Copies of the log with as much noise again, from which the noise of each window is taken."""
NEAR = 12
"""Windows to either side over which the noise of one is averaged."""
MEASURED = "The noise of {} is allowed for: the residuals show that such inputs are measured, not commanded."
ROUNDED = (
    "What the log rounds off {} counts as noise: no cause explains the residuals, which have the size that it leaves."
)
LASTS = (
    "The noise of {} lasts longer than a sample, as a sensor's filter leaves it: what nothing explains has its size "
    "over short and over long times. It counts as noise."
)
_LEAST = 1e-6


class WindowNoise(Tolerances, ABC):
    """The noise of the windows of a log at ports, estimated from the log itself."""

    simulates = False
    """Whether residuals are those of simulated stretches, not of the equations at the logged states."""
    run: np.ndarray
    first: np.ndarray
    time: np.ndarray
    measured: np.ndarray
    memory: np.ndarray
    notes: list[str]
    stretch: float
    pace: float
    n: int
    """Samples per window."""
    _u: np.ndarray
    """Inputs at each row."""
    _copies: list[dict[str, np.ndarray]]
    _drawn: np.ndarray
    hears_inputs = False
    """Whether the noise of inputs counts."""
    hears_rounding = False
    """Whether what the log rounds off inputs counts."""
    _before: tuple[np.ndarray, list[dict[str, np.ndarray]], np.ndarray, str] | None = None
    """Draws, noisier copies and weights before noise of readings lasted, and the note on it; None if it never did."""
    by_inputs = 0.0
    """Size of that noise in the residuals if it counted, in units of the noise of readings."""
    beyond_inputs = False
    """Whether residuals are larger than both together."""
    exact_inputs = False
    """Whether residuals are too small for that noise."""
    _unresolved: np.ndarray | float = 0.0
    _opened: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]] = ()
    """Jumps at unknown instants, how far rows may be off, and what noise this makes of each window."""

    def without_causes(self) -> RobustFit:
        """Return the fit of parameters and clocks without any cause."""
        return self._fitted(self.z0)

    def _fitted(self, z: np.ndarray) -> RobustFit:
        """Return the fit of parameters and clocks to white residuals."""
        return solve(z, self.J, *self.ends, self.parts, self.weights)

    @abstractmethod
    def _under_inputs(self, u: np.ndarray) -> np.ndarray:
        """Return the change of the residuals under other inputs."""

    def _accuracy(self, equation: int) -> float:
        """Return the least noise of an equation, as a share of its measured side."""
        return 0.0

    def _between(self) -> np.ndarray | float:
        """Return the size of what is unknown at each window of the motion between rows."""
        return 0.0

    def channel_noise(self, name: str, width: int = 10) -> float:
        """Return the standard deviation of a channel's noise per sample."""
        return white_over(self.log.channels[name], self.log.spans, width) / self.shown_of_noise(name, width)

    def shown_of_noise(self, name: str, width: int = 10) -> float:
        """Return the share of the noise of readings that neighbouring rows show, which may be interpolated."""
        rows = self.log.between.get(name)
        if rows is None:
            return 1.0
        rng = np.random.RandomState(2)
        shown = [white_over(rows.noise(rng), self.log.spans, width) for _ in range(REPLICATES)]
        return float(np.sqrt(np.mean(np.square(shown))))

    def _draw_noise(self) -> None:
        """Estimate the noise of each window from copies of the log with as much noise again."""
        rng = np.random.RandomState(0)
        exact = self.simulator.inputs if self.simulator.form != "algebraic" else ()  # commands
        known = {n: self.channel_noise(n) for n in self.log.channels if n not in exact}
        lasting = known if self.simulates else {}  # a rate of readings does not see an error that lasts
        self._copies = noisy_copies(REPLICATES, self.log, known, lasting, self.n, rng)
        drawn = np.stack([self._residual(self._own, self.simulator.numbers, c) - self.value for c in self._copies])
        self.noise = np.empty(len(self.value))
        self._drawn, self._unresolved = drawn, self._between()
        self._level()

    def _level(self) -> None:
        """Set the noise of each window from draws of the noise of all."""
        for k, part in enumerate(self.parts):
            power = np.mean(np.square(self._drawn[:, part]), axis=0)
            for run in np.unique(self.run[part]):
                mine = self.run[part] == run
                power[mine] = smoothed(power[mine], NEAR)
            typical = float(np.median(power)) if len(power) else 0.0
            accuracy = max(_LEAST * rms(self.value[part]), self._accuracy(k) * rms(self.measured[part]))
            least = max(0.04 * typical, accuracy**2, 1e-300)
            self.noise[part] = np.sqrt(np.maximum(power, least))
        self.noise = np.hypot(self.noise, self._unresolved)

    def hear_inputs(self, fitted: RobustFit | Fit | None = None) -> bool:
        """Return whether what a fit, without causes by default, leaves shows the noise of inputs, which then counts.

        What a log rounds off is asked for where a fit is given: a small cause must have been looked for before.
        """
        if self.simulator.form == "algebraic":  # whose inputs are readings anyway
            return False
        u, names = self._u, self.simulator.inputs
        sigma = rough_inputs(u, self.log.spans)
        rough = [
            (name, lambda rng, e=e: e[:, None] * rng.standard_normal(u.shape))
            for name, e in zip(names, np.diag(sigma), strict=True)
            if np.any(e)
        ]
        if not self.hears_inputs and self._hear(rough, fitted, MEASURED):
            self.hears_inputs = True
            return True
        if fitted is None or self.hears_rounding:
            return False
        rounded = [
            (name, lambda rng, e=e: rounded_off(u, e, self.log.starts, rng))
            for name, e in zip(names, np.diag(roundings(u, sigma)), strict=True)
            if np.any(e)
        ]
        self.hears_rounding = self._hear(rounded, fitted, ROUNDED, lasting=True)
        return self.hears_rounding

    def _hear(
        self,
        each: Sequence[tuple[str, Callable[[np.random.RandomState], np.ndarray]]],
        fitted: RobustFit | Fit | None,
        note: str,
        lasting: bool = False,
    ) -> bool:
        """Return whether residuals show noise of inputs, by draws of that of each, which then counts."""
        if not each:
            return False
        begin = [p.start for p in self.parts if p.stop > p.start]
        new = np.union1d(begin, np.flatnonzero(np.diff(self.run)) + 1).astype(int).tolist()
        adds_up = self.simulates or lasting

        def quick(z: np.ndarray) -> np.ndarray:
            # Predictions go astray slowly by the noise of inputs.
            return z if adds_up else without_slow(z, new, NEAR)

        def judged(r: np.ndarray) -> np.ndarray:
            # A fit of parameters takes from noise that lasts what it can, as it did from the residuals.
            z = self._whitening.white(r / self.noise)
            return quick(self._fitted(z).z if adds_up else z)

        shortens = self.simulates and self.simulator.form == "ode" and fitted is None  # see `beside_inputs`
        fitted = fitted or self.without_causes()
        left = quick(fitted.z)
        readings = np.array([judged(one) for one in self._drawn])
        beyond = exceeds(left, readings, self.parts)
        if not (beyond or shortens):
            return False
        rng, count = np.random.RandomState(1), len(self._drawn)
        different = count if self.simulator.form != "run" else 2  # each is a run of the simulator
        noise = [[draw(rng) for _ in range(different)] for _, draw in each]
        within = dict(zip(self.free, fitted.x + self.about, strict=True))
        draws = [
            [self._under_inputs(self._u + timed(e, within, self.simulator.inputs, self.log)) for e in some]
            for some in noise
        ]
        alike = [np.array([judged(one) for one in some]) for some in draws]
        alone = [x[np.arange(count) % different] for x in alike]
        every = np.sum(alone, axis=0)
        self.by_inputs = relative(every, readings, self.parts)
        self.beyond_inputs = exceeds(left, readings + every, self.parts, surely=True)
        self.exact_inputs = quieter(left, readings, readings + every, self.parts)
        which = shown(left, readings, alone, self.parts) if beyond else []
        if not which:
            return False
        for k in which:
            self._drawn += np.array(draws[k])[np.arange(count) % different]
        louder = self._u + np.sum([noise[k][(count - 1) % different] for k in which], axis=0)
        self._copies[-1] = {**self._copies[-1], **dict(zip(self.simulator.inputs, louder, strict=True))}
        self.notes.append(note.format(" and ".join(each[k][0] for k in which)))
        self._renew()
        return True

    @property
    def hears_memory(self) -> bool:
        """Whether noise of readings was found to last, and is still taken for that."""
        return self._before is not None and self._before[-1] in self.notes

    def hear_memory(self, fitted: Fit) -> bool:
        """Return whether a fit leaves what lasting noise of readings does in each octave of time, which then counts."""
        if self._before is not None or self.hears_inputs or self.hears_rounding:
            return False
        exact = self.simulator.inputs if self.simulator.form != "algebraic" else ()  # commands
        log, octaves, rng = self.log, Octaves(self.parts, self.run), np.random.RandomState(3)
        names = [n for n in log.channels if n not in exact]
        if not len(octaves.counts):
            return False
        errors = [self._lasting_errors(name, rng) for name in names]
        changes = [[self._changed_by(name, e) for e in some] for name, some in zip(names, errors, strict=True)]
        Q = np.linalg.qr(self.J)[0] if self.J.shape[1] else self.J

        def left(drawn: np.ndarray) -> np.ndarray:
            # A fit of parameters takes from it what it can, as it did from the residuals.
            z = self._whitening.white((drawn / self.noise).T)
            return octaves.powers(self._whitening.raw(z - Q @ (Q.T @ z)).T)

        noises = [np.array([left(z).mean(axis=0) for z in some]) for some in changes]
        [power] = octaves.powers(self._whitening.raw(fitted.z)[None])
        chosen = likeliest(octaves, power, noises)
        if not any(one.memory for one in chosen):
            return False
        drawn = np.sum([c.size * some[c.memory] for some, c in zip(changes, chosen, strict=True)], axis=0)
        if not octaves.within(power, left(drawn)):
            return False
        lasts = [(n, c.size * e[c.memory], c.memory) for n, e, c in zip(names, errors, chosen, strict=True) if c.memory]
        copies = [{**copy, **{n: log.channels[n] + e[k] for n, e, _ in lasts}} for k, copy in enumerate(self._copies)]
        before, weights, z = (self._drawn, self._copies), self.weights, self._whitening.raw(fitted.z) * self.noise
        self._hear_draws(drawn, copies)
        if self._follows_signals(names, self._whitening.white(z / self.noise)):
            self._hear_draws(*before)
            self.weights = weights
            return False
        said = (f"{n} ({memories(log.channels[n], log.spans)[m - 1]:.2g} samples)" for n, _, m in lasts)
        self.notes.append(LASTS.format(" and ".join(said)))
        self._before = (*before, weights, self.notes[-1])
        return True

    def hear_less(self) -> None:
        """Take the noise of readings for what it was before it lasted, for good."""
        if self.hears_memory and self._before is not None:
            drawn, copies, weights, note = self._before
            self._hear_draws(drawn, copies)
            self.weights = weights
            self.notes.remove(note)

    def _hear_draws(self, drawn: np.ndarray, copies: list[dict[str, np.ndarray]]) -> None:
        """Take the noise of each window from other draws."""
        self._drawn, self._copies = drawn, copies
        self._renew()

    def _follows_signals(self, names: Sequence[str], z: np.ndarray) -> bool:
        """Return whether an error of a reading shows that goes with a signal in waves, which noise does not.

        It explains more than noise of its octave would by chance, and more than the size of noise is uncertain by.
        """
        signals, most = self.log.channels, int(2.0 * np.sqrt(len(z)))
        chance = float(np.log(most * len(names) * len(signals) / FALSE_ALARM))
        drawn = self._whitening.white((self._drawn / self.noise).T)
        for name, signal in itertools.product(names, signals):
            found, noise = [], self.channel_noise(name)
            for errors in waves(signals[signal], most):
                B = self._whitening.white((self._changed_by(name, noise * errors) / self.noise).T)
                Q, there = np.linalg.qr(B)[0], z[np.any(B, axis=1)]
                power = np.sum(np.square(Q.T @ np.column_stack([z, drawn])), axis=0)
                found.append((power[0] / 2.0, np.mean(power[1:]) / 2.0, power[0] / max(there @ there, 1e-300)))
            power, chances, share = np.array(found).T  # by chance as much as one where noise is white
            if np.any((power > chance * np.maximum(smoothed(chances, 2), 1.0)) & (share > EXCESS)):
                return True
        return False

    def _lasting_errors(self, name: str, rng: np.random.RandomState) -> list[np.ndarray]:
        """Return draws of a reading's noise, each of shape (n_draws, n): as estimated, and with each memory."""
        x, shown = self.log.channels[name], self.channel_noise(name)
        white = np.array([copy[name] for copy in self._copies]) - x
        return [
            white,
            *(lasting(memory, shown, self.log.spans, len(white), rng) for memory in memories(x, self.log.spans)),
        ]

    def _changed_by(self, name: str, errors: np.ndarray) -> np.ndarray:
        """Return what errors of a reading change in the residuals."""
        x = self.log.channels
        copies = ({**x, name: x[name] + error} for error in errors)
        return np.array([self._residual(self._own, self.simulator.numbers, copy) - self.value for copy in copies])

    def time_jumps(self) -> None:
        """Count as noise that jumps of inputs come at unknown instants between two rows.

        Where rows were interpolated, no simulator knows. Where they were read, only a simulator of whole runs says
        nothing of what it makes of inputs between rows: then residuals have to show it, and nothing else. A lag of an
        input, too, shows after its jumps.
        """
        if self.simulator.form not in ("run", "ode"):
            return
        off, known = off_rows(self.simulator.inputs, self.log), self._unresolved
        if np.any(off):
            self._open_instants(np.zeros_like(off), off)
        jump = jumps(self._u, self.log) if self.simulator.form == "run" else np.zeros_like(off)
        if np.any(jump) and np.any((before := self.without_causes()).scales > 1.0 + EXCESS):
            least, noise = self._unresolved, self.noise
            self._open_instants(jump, np.zeros_like(off))
            louder = np.log(self.noise / noise)
            cost = sum(w * np.sum(louder[p]) for w, p in zip(self.weights, self.parts, strict=True))
            after = self.without_causes()
            if np.any(after.scales > 1.0 + EXCESS) or after.loglik - cost <= before.loglik + LEAST_GAIN:
                self._leave_open(least)
                self._opened = self._opened[:-1]
        if self._unresolved is not known:
            self.notes.append(NOTE)

    def _open_instants(self, jump: np.ndarray, off: np.ndarray) -> None:
        more = unknown_instants(jump, off, lambda change: self._under_inputs(self._u + change), REPLICATES)
        self._opened = [*self._opened, (jump, off, more)]
        self._leave_open(np.hypot(self._unresolved, more))

    def _leave_open(self, unresolved: np.ndarray | float) -> None:
        """Count as noise what is not known of the motion between rows."""
        if unresolved is not self._unresolved:
            self._unresolved, self.noise = unresolved, np.empty(len(self.value))
            self._renew()

    def _renew(self) -> None:
        """Estimate the noise of each window and what goes with it from draws that have changed."""
        self._level()
        self._correlate()
        self._lay_again()

    def _lay_again(self) -> None:
        """Compute white residuals and slopes with noise that has changed."""
        self._laid.clear()
        self.z0 = self._whitening.white(self.value / self.noise)
        self.J = self._slopes_at(self._own, np.zeros(len(self.free)))

    def _correlate(self) -> None:
        """Estimate how the noise of each window goes with that of others."""
        self.memory = np.ones(len(self.parts))
        self._repeat()
        self._whiten()
        self.weights = 1.0 / self.memory

    def _repeat(self) -> None:
        """Estimate the noise from repeated runs: smoothed or drifting readings hide it between neighbouring samples."""
        # Such noise is correlated, too: that many windows count as one.
        found: list[list[tuple[float, float, int]]] = [[] for _ in self.parts]
        inputs, channels = self.simulator.inputs, self.log.channels
        if self.simulator.form == "algebraic":  # without a state that begins elsewhere, inputs alone say what repeats
            channels = {k: x for k, x in channels.items() if k in inputs}
        for pair in repeating(replace(self.log, channels=channels), inputs):
            for k, spread in enumerate(self._differences(*pair)):
                if len(spread) >= FEWEST:
                    memory = memory_of(spread, np.zeros(len(spread), int))
                    found[k].append((float(np.mean(np.square(spread))), memory, len(spread)))
        for k, (part, some) in enumerate(zip(self.parts, found, strict=True)):
            if some:
                power, memory, count = np.array(some).T
                more = float(np.average(power, weights=count))
                self.noise[part] *= np.sqrt(max(1.0, more))
                self.memory[k] = float(np.average(memory, weights=count)) if more > 1.0 else 1.0

    def _differences(self, a: int, b: int) -> list[np.ndarray]:
        """Return for each equation by how much the residuals of two runs differ, in units of the noise of both."""
        found = []
        for part in self.parts:
            one, two = self._common(part, a, b)
            spread = self.value[one] - self.value[two]
            found.append(spread / np.hypot(self.noise[one], self.noise[two]))
        return found

    def _common(self, part: slice, a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the windows of an equation that two runs have at the same times."""
        mine = [np.flatnonzero(self.run[part] == k) for k in (a, b)]
        at = [self.first[part][m] - self.log.starts[k] for m, k in zip(mine, (a, b), strict=True)]
        _, one, two = np.intersect1d(*at, return_indices=True)
        return part.start + mine[0][one], part.start + mine[1][two]

    def _whiten(self) -> None:
        """Estimate the correlation of the noise of neighbouring windows."""
        self._whitening = Whitening()
        for part in self.parts:
            self._whitening.learn(part, self._drawn[:, part] / self.noise[part], self.run[part])

    def remember(self, left: Sequence[np.ndarray]) -> None:
        """Estimate each equation's noise correlation time from a flexible learner's residuals."""
        for k, (part, rest) in enumerate(zip(self.parts, left, strict=True)):
            if len(rest) > 8:
                memory = max(
                    float(self.memory[k]),
                    memory_of(self._whitening.only(part, rest / self.noise[part], len(self.value)), self.run[part]),
                )
                self.weights[k] = 1.0 / memory
                step = float(np.median(np.diff(self.time[part])))
                span = len(rest) * step
                self.stretch = max(
                    self.stretch, float(np.clip(3.0 * memory * step, 0.0, max(0.3 / self.pace, span / 24.0)))
                )

    def widen(self, times: Mapping[str, float]) -> None:
        """Scale the noise of equations."""
        for equation, part in zip(self.equations, self.parts, strict=True):
            self.noise[part] *= times.get(equation, 1.0)
            self._drawn[:, part] *= times.get(equation, 1.0)
        self._lay_again()

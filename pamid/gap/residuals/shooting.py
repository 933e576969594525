r"""Residuals of a simulator's predictions over stretches of a log, where the log lacks its states.

Each stretch has its own initial state, fitted to what was measured (multiple shooting), so that chaotic, unstable
and integrating systems do not diverge. The stretches are as long as the simulator can follow the log. What a small
change of the initial states would explain is projected out of the residual,

.. math:: r = (I - O\,O^{+})\,(y - \hat y(x_0)), \qquad O = \partial \hat y/\partial x_0

References
----------
H. G. Bock, K. J. Plitt, "A multiple shooting algorithm for direct solution of optimal control problems", IFAC
Proceedings Volumes 17(2), 1984. https://doi.org/10.1016/S1474-6670(17)61205-9
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from operator import methodcaller
from typing import NamedTuple

import numpy as np

from ...effects import Parameter
from ...equations.noise import channel_noise, noise_beside
from ...signals.ends import end_of
from ...simulators.accelerations import rates_read
from ...simulators.base import Simulator
from ...simulators.integrate import side_by_side, substeps_for
from ...simulators.port_log import PortLog
from ...simulators.sizes import SignalSizes
from ...simulators.structure import fed_by, joints_of, kinematic_pairs, pushes_of, some_instants
from ..settings import DECIDED, EXCESS
from .between_rows import SEMI_IMPLICIT, STEPS, WHOLE, needed, timings
from .influence import Influence
from .port_signals import PortWindows
from .predictions import MOST_RUNS, PredictedEvidence, named
from .protocol import Active, Spec
from .response import Drive
from .segments import SHORTEST, cut
from .states import integral, read_joints, roles_of
from .stretches import ROUNDS, StretchEvidence
from .tolerances import rms, typical
from .window_length import LEAST_WINDOWS, longest_window, no_windows

UNSURE = 4.0
"""Factor by which a state that is not logged may be larger or smaller than with parameters that had to be fitted."""


def holds(active: Active) -> bool:
    """Return whether an effect holds a motion at rest."""
    return any(made.holds for _, made in active)


class Begun(NamedTuple):
    """Initial states under a change."""

    x0: np.ndarray
    influence: Influence
    """How they act on the windows there."""


class ShootingEvidence(PredictedEvidence):
    """Residuals of predictions over stretches of a log."""

    simulates = True
    longer: ShootingEvidence | None = None
    """The same over longer stretches, of which noise of inputs explains more."""

    def __init__(
        self, log: PortLog, simulator: Simulator, whole: bool = False, refit: bool = False, lines: bool = False,
        longest: int = 0, like: StretchEvidence | None = None, halves: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(log, simulator, whole, refit, lines, longest, like, halves)
        self.shown = [n for n in (*simulator.outputs, *simulator.states) if n in log.channels]
        if simulator.form == "run":
            self.shown = [n for n in self.shown if n in simulator.outputs]
        self._readings_noise: dict[str, float] = {}
        self.sigma = {n: max(self.channel_noise(n), 1e-4 * float(np.std(log.channels[n])), 1e-12) for n in self.shown}
        self.pushes: dict[tuple[str, str], float] = {}
        found = {n: end_of(log.channels[n], log.spans) for n in self.shown}
        self.saturated = {n: end for n, end in found.items() if end is not None}
        self._from: dict[int, Begun] = {}
        self._last: dict[tuple[str, ...], tuple[Active, np.ndarray]] = {}
        self._slow_down()
        self._lay()
        self._look_at_noise()
        # A stretch has enough windows that its initial state leaves something to compare.
        shortest = min(s.stop - s.first for s in self.stretches)
        self.n = max(1, min(log.n // LEAST_WINDOWS, shortest // SHORTEST, self._fastest()))
        self._look()
        if self.substeps > 1:
            self._look_at_noise()  # what the integrator missed is no noise
        self._blocks()
        self._refuse_failure()
        self._skew()
        self._settle()

    def _slow_down(self) -> None:
        """Take steps so short that no fast state runs away before its initial value is fitted; `_look` refines them."""
        if self.simulator.form == "ode" and self.simulator.states:
            self.stretches = cut(self.log.spans, max(b - a for a, b in self.log.spans))
            self.substeps = self._enough(self._starts(), SHORTEST, {}, share=1.0)

    def _enough(self, x0: np.ndarray, most: int, needed: Mapping[str, float], share: float) -> int:
        """Return the steps per sample that some stretches need in their first rows, from initial states."""
        simulator, log, some = self.simulator, self.log, self.stretches[:8]
        length = min(max(s.stop - s.first for s in self.stretches), most)
        rows = side_by_side(some, length)
        numbers, u = np.repeat(simulator.numbers[:, None], len(some), axis=1), np.moveaxis(self._u[:, rows], 0, 1)
        return substeps_for(simulator, log.dt, log.t[rows], x0[:, : len(some)], u, numbers, needed, share=share)

    def _fastest(self) -> int:
        """Return the longest window that averages no motion away: what is fast only in a reading may be noise."""
        plain = self._predict(self._x0, [], self.simulator.numbers)
        pairs = [(self.log.channels[n], drive) for n, drive in zip(self.shown, plain, strict=True)]
        return min(max(longest_window(x, self.log) for x in pair) for pair in pairs)

    def _look_at_noise(self) -> None:
        """Remove predicted motion that is fast for the sampling from the differences of neighbouring samples."""
        plain = self._fold(self._predict(self._x0, [], self.simulator.numbers))
        for name, drive in zip(self.shown, plain, strict=True):
            x, least = self.log.channels[name], self.sigma[name]
            found = [noise_beside(x[a:b], drive[a:b], channel_noise(x[a:b], 10)).white for a, b in self.log.spans]
            lengths = [b - a for a, b in self.log.spans]
            white = float(np.sqrt(np.average(np.square(found), weights=lengths))) / self.shown_of_noise(name)
            self._readings_noise[name] = min(least, white)
            self.sigma[name] = max(self._readings_noise[name], 1e-4 * float(np.std(x)), 1e-12)

    def _with_lines(self) -> np.ndarray:
        """Return the change of the residuals by inputs that go straight from row to row."""
        base = self._drive([], self.simulator.numbers)
        return self._compared([], [], map(self._fold, self._held_and_in_lines(self._x0, base)))

    def channel_noise(self, name: str, width: int = 10) -> float:
        """Return the standard deviation of a channel's noise per sample, after removing what was predicted."""
        return self._readings_noise.get(name) or super().channel_noise(name, width)

    def _look(self) -> None:
        """Simulate the log: states along it, joints, and the influence of inputs."""
        simulator, log = self.simulator, self.log
        self._states = np.zeros((len(simulator.states), log.n))
        if simulator.form != "ode":
            self.joints, self._read_speeds = read_joints(simulator, log)
            return
        p = np.repeat(simulator.numbers[:, None], log.n, axis=1)
        # A window's noise is that of a mean, while errors of integration do not average out in it.
        needed = {name: EXCESS * sigma / np.sqrt(self.n) for name, sigma in self.sigma.items()}
        self.substeps = self._enough(self._x0, 400, needed, share=1e-3)
        self._x0 = self._fitted_from(self._x0)[0] if self.substeps > 1 else self._x0
        self._states, _ = self._simulate(self._x0, self._u, p, [])
        at = some_instants(log.n)
        x, u = self._states[:, at], self._u[:, at]
        self._pairs = kinematic_pairs(simulator, log.t[at], x, u)
        self.pushes = pushes_of(simulator, log.t[at], x, u, 1e-3 * np.array([np.ptp(v) or 1.0 for v in self._u]))
        self.joints = joints_of(simulator, self._pairs, self.pushes)
        self._felt = rates_read(simulator, {j.velocity for j in self.joints}, log.t[at], x, u)
        self._responses.clear()  # those of the start know no path of a joint
        self.feeds = fed_by(simulator, log.t[at], x, u)
        self._rates = simulator.rate(log.t, self._states, self._u, p)

    def _again(self) -> None:
        """Clear caches of the simulator with other parameters."""
        self._x0 = self._unless_apart(*self._fitted_from(self._x0))
        for kept in (self._moved, self._done, self._from, self._last, self._responses, self._jumped, self._growths):
            kept.clear()
        self._blocks()

    # --- residuals ------------------------------------------------------------------------------------------
    def _blocks(self) -> None:
        read = np.concatenate([[0], np.cumsum(~self.log.lost)])
        firsts = [np.arange(s.first, s.stop - self.n + 1, self.n) for s in self.stretches]
        firsts = [f[2 * (read[f + self.n] - read[f]) >= self.n] for f in firsts]
        rows = np.concatenate(firsts)
        if not len(rows):
            raise no_windows(self.log, self.n)
        self._window_of = np.repeat(np.arange(len(firsts)), [len(f) for f in firsts])
        self._rows = rows[:, None] + np.arange(self.n)
        kept = (~self.log.lost[self._rows]).astype(float)
        self._share = kept / np.sum(kept, axis=1, keepdims=True)
        self.windows = [
            PortWindows(n, self.simulator.port(n).unit, rows, rows + self.n // 2, self._means(self.log.channels[n]))
            for n in self.shown
        ]
        self._plain = self._predict(self._x0, [], self.simulator.numbers)
        self._usual = float(np.sum(self._squares(self._left(self.log.channels, self._plain))))
        self._begins = self._slopes(self._x0)
        self._O = self._influence(self._begins)

    def _skew(self) -> None:
        """Allow inputs to act up to half a sample early or late, and steps of an integrator, within tolerances."""
        base = self._drive([], self.simulator.numbers)
        self.skews |= needed(self._timed(self._own), self._u, self.simulator.inputs, self.log)
        if self.simulator.form == "ode":
            positions = [self.simulator.states.index(position) for position in self._pairs]
            for method, new_speed in {STEPS: [], **({SEMI_IMPLICIT: positions} if positions else {})}.items():
                for of, ending in (("of_steps", ""), ("of_whole_steps", WHOLE)):
                    stepped = self._responded(self._x0, base, base, methodcaller(of, new_speed))
                    column = self._compared([], [], map(self._fold, stepped))
                    if np.any(column):
                        self.skews[method + ending] = column
        self._allow()

    def _timed(self, active: Active) -> dict[str, np.ndarray]:
        base, found = self._drive(active, self.simulator.numbers), {}
        for name, u in timings(active, self._u, self.simulator.inputs, self.log, not self.lines):
            near = self._near(self._x0, base, Drive(u, base.p, active, self.lines))
            found[name] = self._compared(active, active, map(self._fold, near))
        return found

    def _passes_on(self, active: Active) -> tuple[Active, set[str]]:
        on, inputs = super()._passes_on(active)
        read = [(place, made) for place, made in active if place.enters == "output"]
        if self.simulator.form != "ode":  # each timing would be a run
            return [], set()
        return [*on, *read], set(self.simulator.inputs) if read else inputs

    def _means(self, x: np.ndarray) -> np.ndarray:
        """Return means over the readings in windows."""
        return np.asarray(np.einsum("...wn,wn->...w", x[..., self._rows], self._share))

    def _influence(self, slopes: np.ndarray) -> Influence:
        """Return how initial states act on the windows."""
        return Influence(self._means(slopes), self._window_of, len(self.stretches))

    def _residual(
        self, active: Active, numbers: np.ndarray, channels: Mapping[str, np.ndarray] | None = None
    ) -> np.ndarray:
        readings = channels or self.log.channels
        changed = bool(active) or not np.array_equal(numbers, self.simulator.numbers)
        kind = tuple(place.key for place, _ in active)
        x0 = self._started(kind, active, numbers) if changed and channels is None else self._x0
        predicted = self._predict(x0, active, numbers) if changed else self._plain
        left = self._left(readings, predicted)
        influence, anew = self._O, changed and channels is None and len(x0) > 0
        if anew:
            if kind not in self._moved or holds(active):
                x0, left = self._read_or(x0, left, active, numbers)
            near = self._from.get(named(*self._last.get(kind, (active, numbers))), Begun(x0, self._O))
            (x0, influence), left = self._begun_best(x0, left, active, numbers, near.influence)
        shift = self._explained(left, influence)
        if anew:
            while len(self._from) >= MOST_RUNS:
                self._from.pop(next(iter(self._from)))
            self._from[named(active, numbers)] = Begun(x0, influence)
            if np.sum(self._squares(left)) <= self._usual:  # what leads astray is no start for others
                self._moved[kind], self._last[kind] = x0 + shift - self._x0, (active, numbers)
        return self._without(left, shift, influence)

    def _without(self, left: np.ndarray, shift: np.ndarray, influence: Influence) -> np.ndarray:
        """Return residuals less what changes of the initial states explain."""
        return (left - influence.moved(shift) * self._scale).ravel()

    def _read_or(
        self, x0: np.ndarray, left: np.ndarray, active: Active, numbers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return initial states and what they leave, as measured where this is less: what holds a joint hides them."""
        read = self._starts()
        trial = self._left(self.log.channels, self._predict(read, active, numbers))
        better = self._squares(trial) < self._squares(left)
        return np.where(better, read, x0), np.where(better[self._window_of], trial, left)

    def _begun_best(
        self, x0: np.ndarray, left: np.ndarray, active: Active, numbers: np.ndarray, near: Influence
    ) -> tuple[Begun, np.ndarray]:
        """Return the initial states that fit best under a change, and what they leave; how they act `near` it."""
        read = self._as_read(x0, active, numbers)
        if read is None and holds(active):
            read = self._slopes(x0, numbers, active)
        influence = near if read is None else self._influence(read)
        power, share = self._squares(left), np.ones(len(self.stretches))
        for done in range(ROUNDS):
            shift = self._explained(left, influence)
            if not self._far(shift, influence):
                break
            # Changes that fit worse than none from any start need no exact one.
            if done and np.sum(self._squares(left - influence.moved(shift) * self._scale)) > self._usual:
                break
            trial = self._left(self.log.channels, self._predict(x0 + share * shift, active, numbers))
            found = self._squares(trial)
            better = found < power
            if not better.any():
                break
            x0, left = np.where(better, x0 + share * shift, x0), np.where(better[self._window_of], trial, left)
            share = np.where(better, np.minimum(2.0 * share, 1.0), 0.25 * share)
            gained, power = float(np.sum((power - found)[better])), np.where(better, found, power)
            if self.simulator.form == "ode":
                influence = self._influence(self._slopes(x0, numbers, active))
            if gained * left.size < len(x0) * np.sum(power):  # as much as what is left gives as many initial states
                break
        return Begun(x0, influence), left

    def _started(self, kind: tuple[str, ...], active: Active, numbers: np.ndarray) -> np.ndarray:
        """Return predicted initial states after a change, to first order from the last one of its kind."""
        read = {place.at for place, _ in active if place.name == "sensor_rectification"}
        if not len(self._x0) or self.simulator.form == "run" or read & set(self.folds):
            # The response may itself be a run; and to a reading without its sign initial states are fitted already.
            return self._x0 + self._moved.get(kind, 0.0)
        if holds(active) and not holds(self._own) and kind not in self._moved:
            return self._starts()  # a run that nothing holds begins elsewhere
        about, known = self._last.get(kind, (self._own, self.simulator.numbers))
        # The response of the unchanged run is known, and close enough as a start.
        there, before = (
            self._near(self._x0, self._drive(self._own, self.simulator.numbers), self._drive(a, p))[1]
            for a, p in ((active, numbers), (about, known))
        )
        left = -self._means_of_change(about, active, before, there)
        return self._x0 + self._moved.get(kind, 0.0) + self._explained(left)

    def change(self, spec: Spec, about: Spec, x: np.ndarray) -> np.ndarray:
        """Return by how much the residuals change from effects to others, to first order: nothing is run again."""
        numbers = self.numbers(dict(zip(self.free, map(float, x), strict=True)))
        found = self._changed(self.active(spec), numbers, self.active(about), numbers)
        return self._whitening.white(found / self.noise)

    def _moved_by(self, steps: Sequence[np.ndarray], x: np.ndarray, active: Active) -> list[np.ndarray]:
        """Return what steps of the tolerances change, to first order and without effects whose memory they change."""
        at = [(place, made) for place, made in active if made.holds or not (place.acts and made.n_states)]
        return [self._changed(at, self._numbers_at(x + s), at, self._numbers_at(x)) for s in steps]

    def _changed(self, active: Active, numbers: np.ndarray, about: Active, known: np.ndarray) -> np.ndarray:
        """Return the change of the residuals under effects and numbers near others, whose run is known."""
        begun = self._from.get(named(about, known), Begun(self._x0, self._O))
        near = self._near(begun.x0, self._drive(about, known), self._drive(active, numbers))
        found = self._compared(about, active, near, begun.influence)
        return np.where(np.isfinite(found), found, 0.0)  # residuals of a run that fails are as large whatever changes

    def _compared(
        self, about: Active, active: Active, predictions: Iterable[np.ndarray], influence: Influence | None = None
    ) -> np.ndarray:
        """Return the change of the residuals from predictions to others, less what initial states explain."""
        base, there = predictions
        left, influence = -self._means_of_change(about, active, base, there), influence or self._O
        return self._without(left, self._explained(left, influence), influence)

    def _means_of_change(self, about: Active, active: Active, base: np.ndarray, there: np.ndarray) -> np.ndarray:
        """Return the difference of predictions as sensors read them, as means over windows."""
        before, after = self._read(about, base, self.shown), self._read(active, there, self.shown)
        return self._means(np.clip(np.nan_to_num(after - before), -1e12, 1e12))

    def _left(self, readings: Mapping[str, np.ndarray], predicted: np.ndarray) -> np.ndarray:
        """Return measured less predicted, as means over windows, shape (n_shown, n_windows)."""
        return self._means(self._readings(readings) - np.clip(np.nan_to_num(predicted), -1e12, 1e12))

    def _far(self, shift: np.ndarray, influence: Influence) -> bool:
        """Return whether initial states change by more than noise would cause, so that first order is inexact."""
        moved = influence.moved(shift) * self._scale
        return bool(np.sum(self._squares(moved)) > moved.size)

    def _squares(self, rows: np.ndarray) -> np.ndarray:
        """Return the sum of squares of each stretch's windows, in units of their noise."""
        power = np.sum(np.square(rows / self._scale), axis=0) * self.n
        return np.bincount(self._window_of, power, len(self.stretches))

    def _explained(self, left: np.ndarray, influence: Influence | None = None) -> np.ndarray:
        """Return the changes of the initial states that explain most of the residual."""
        return (influence or self._O).explained(left / self._scale)

    def _differences(self, a: int, b: int) -> list[np.ndarray]:
        """Return the difference of two runs; what initial states explain is taken out of it, not of each run."""
        if not len(self._x0):
            return super()._differences(a, b)
        whole = self._left(self.log.channels, self._plain).ravel()
        slopes, stretch = np.moveaxis(self._O.slopes * self._scale, 1, 0), self._window_of
        n = len(stretch)
        at, spreads, columns = [], [], []
        for j, part in enumerate(self.parts):
            one, two = self._common(part, a, b)
            both = np.hypot(self.noise[one], self.noise[two])
            spreads.append((whole[one] - whole[two]) / both)
            columns.append((slopes[j][:, one - j * n] / both).T)
            at.append(stretch[one - j * n])
        place, spread, A = np.concatenate(at), np.concatenate(spreads), np.concatenate(columns)
        for k in np.unique(place):
            mine = place == k
            spread[mine] -= A[mine] @ np.linalg.lstsq(A[mine], spread[mine], rcond=1e-9)[0]
        ends = np.cumsum([0, *(len(x) for x in at)])
        return [spread[x:y] for x, y in pairwise(ends)]

    # --- for the diagnosis ----------------------------------------------------------------------------------
    def prior(self, name: str) -> float:
        """Return the log odds of an effect; a reading that stands while the simulator moves on shows its end itself."""
        place, odds = self.placements.get(name), super().prior(name)
        if place is None or place.name != "sensor_saturation" or place.at not in self.saturated:
            return odds
        end, part = self.saturated[place.at], self.parts[self.equations.index(place.at)]
        beyond = -np.sign(self.measured[part]) * self.value[part] > 3.0 * self.noise[part]
        standing = np.array([end.rows[a : a + self.n].all() for a in self.first[part]])
        return odds + min(DECIDED, self.n * end.surprise * int(np.sum(standing & beyond)))

    def _survey(self, gaps: Mapping[str, float]) -> SignalSizes:
        log, simulator = self.log, self.simulator
        signals = self.signals()
        spans = {name: float(np.ptp(x)) for name, x in signals.items()}
        sizes = dict(gaps)
        if simulator.form == "ode":
            for k, state in enumerate(simulator.states):
                sizes[state] = typical(self._rates[k])
            for j in self.joints:  # most are named by their position, but have the size of an acceleration
                sizes[j.name] = typical(self._rates[simulator.states.index(j.velocity)])
                if not j.position:
                    speed = self._states[simulator.states.index(j.velocity)]
                    spans[f"{j.name}.path"] = max(float(np.ptp(np.cumsum(speed[a:b]))) * log.dt for a, b in log.spans)
        else:
            for port in simulator.ports:
                if port.through and (port.velocity in log.channels or port.level in log.channels):
                    sizes[port.name] = sizes[port.velocity or port.level] = self._mattering(port.through, gaps)
            for j in self.joints:
                if not j.position:
                    spans[f"{j.name}.path"] = float(np.ptp(integral(log.channels[j.velocity], log)))
        lengths = [(b - a) * log.dt for a, b in log.spans]
        tops = {name: float(np.max(np.abs(x))) for name, x in signals.items()}
        lows = {name: float(np.min(x)) for name, x in signals.items()}
        highs = {name: float(np.max(x)) for name, x in signals.items()}
        for name in self._unsure():
            lows[name], highs[name] = lows[name] / UNSURE, highs[name] * UNSURE
        length = float(np.median(lengths))
        ends = {name: end.limit for name, end in self.saturated.items()}
        one_sided = {name: end.side for name, end in self.saturated.items() if end.side}
        return SignalSizes(
            spans, tops, lows, sizes, self.shown, self.pushes, self.joints, length, log.dt, self.feeds, ends,
            one_sided, highs, log.again,
        )  # fmt: skip

    def _unsure(self) -> list[str]:
        """Return the states whose size the log does not determine: hidden ones, with fitted parameters."""
        simulator = self.simulator
        hidden = [s for s in simulator.states if s not in self.log.channels]
        return hidden if self.curved and simulator.form == "ode" else []

    def reached(self, p: Parameter) -> Parameter:
        """Return a parameter with the bounds between which it changes anything on this log."""
        for place in self.placements.values():
            if place.name == "overflow" and p in place.effect.parameters and p.name == "level":
                x, s = self.signals()[place.follows["pressure"]], place.scales
                low, high = (float(v) * s.pressure + s.offset for v in (np.min(x), np.max(x)))
                edge = 0.02 * (high - low)
                low, high = max(p.lower, low + edge), min(p.upper, high - edge)
                return replace(p, lower=low, upper=high, nominal=0.5 * (low + high)) if low < high else p
        return p

    def _mattering(self, name: str, gaps: Mapping[str, float]) -> float:
        """Return the constant input that would cause a gap of the observed size."""
        k, u = self.simulator.inputs.index(name), self._u.copy()
        step = float(np.ptp(u[k])) or 1.0
        u[k] += step
        p = np.repeat(self.simulator.numbers[:, None], self.log.n, axis=1)
        moved = self._ran(self._x0, u, p)
        base = self._ran(self._x0, self._u, p)
        sizes = []
        for row, output in enumerate(self.simulator.outputs):
            reach = rms(moved[row] - base[row])
            if output in gaps and reach > 0.0:
                sizes.append(step * max(gaps[output], self.sigma[output]) / reach)
        return min(sizes, default=step)

    def predicted(self, more: Sequence[str] = ()) -> dict[str, np.ndarray]:
        """Return the channels that the simulator with its effects predicts, from the best initial states."""
        active, numbers = self._own, self.simulator.numbers
        x0 = self._starts()
        for _ in range(ROUNDS if len(x0) else 0):
            left = self._left(self.log.channels, self._predict(x0, active, numbers))
            slopes = []
            for k in range(len(x0)):
                moved = x0.copy()
                step = 1e-4 * (float(np.max(np.abs(x0[k]))) or 1.0)
                moved[k] += step
                there = self._left(self.log.channels, self._predict(moved, active, numbers))
                slopes.append((left - there) / (step * self._scale))
            shift = self._explained(left, Influence(np.stack(slopes), self._window_of, len(self.stretches)))
            x0 = x0 + shift
            if float(np.max(np.abs(shift))) <= 1e-9 * float(np.max(np.abs(x0)) or 1.0):
                break
        shown = list(dict.fromkeys([*self.shown, *more]))
        return dict(zip(shown, self._predict(x0, active, numbers, shown), strict=True))

    def undetermined(self) -> list[str]:
        """Return the states whose fitted initial values take up a part of the gap: they jump where a stretch begins."""
        begins = np.setdiff1d(self._firsts, self.log.starts)
        jumps = [rms(x) for x in self._states[:, begins] - self._states[:, begins - 1]]
        spread = np.std(self._states, axis=1)
        return [s for s, jump, size in zip(self.simulator.states, jumps, spread, strict=True) if 2.0 * jump > size]

    def signals(self) -> dict[str, np.ndarray]:
        """Return all signals at each row of the log, by name."""
        found = dict(zip(self.simulator.inputs, self._u, strict=True)) | dict(self.log.channels) | self._read_speeds
        for k, state in enumerate(self.simulator.states):
            if state not in found and self.simulator.form == "ode":
                found[state] = self._states[k]
        return found

    def roles(self, equation: str) -> dict[str, str]:
        """Return for an equation the signal of each name of the state, where there is one."""
        found = roles_of(self.simulator, self.joints, equation)
        if self.simulator.form != "ode":
            found = {k: v for k, v in found.items() if v in self.simulator.inputs}
        return found

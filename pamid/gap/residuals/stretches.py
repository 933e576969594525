"""Stretches of a log that a simulator can follow, and their best initial states."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...simulators.base import Simulator
from ...simulators.port_log import PortLog
from ...simulators.structure import full_turns
from ..inference.student_t import bounded
from ..settings import TOLERANCE
from .ports import PortEvidence
from .states import pairs_of, probe
from .tolerances import LAYINGS, differ, rms

FOLLOWS = 0.5
"""Share of a signal's standard deviation that a prediction may miss for its stretch to count as followed."""
ROUNDS = 6
"""Rounds of fitting the initial states."""
GOES = 8
"""Times as long as predictions are within that share from a start that is off, they may be from a better one."""
ASTRAY = 10.0
"""Standard deviations of a signal by which a prediction that runs away misses it."""
APART = 3.0
"""Times that of the others, and the noise, from which a stretch's error may be that of a wrong initial state."""
FIRST_PARTS = 1 / 16, 1 / 8, 1 / 4, 1 / 2
"""Shares of a stretch over which an initial state is fitted then, one after the other."""
SHORT = 60
"""Samples of a stretch where all states are read, and predictions serve to keep their noise out: a drive's windows are
a fifth of that, and many stretches are simulated side by side."""
SHORTEST = 24
"""Least samples of a stretch."""
BELOW = 6.0
"""Standard deviations of the noise below zero that a reading without a sign may be."""
LOST = 1.0, 0.5
"""Shares of the sign that a sensor may not read: a magnitude, and half of the range."""
FORGETS, AT_ONCE, GONE = (500, 2000, 8000), 8, 1e-3
"""Lengths over which it is asked whether a simulator forgets where it began, how many such stretches make it worth
while, and what is then left of an initial state's largest effect."""


class Segment(NamedTuple):
    """A piece of a run."""

    first: int
    stop: int
    """Its rows."""


class StretchEvidence(PortEvidence):
    """What predictions over stretches of a log need: their bounds and initial states.

    With ``whole``, runs are predicted as wholes, however far they diverge; with ``longest``, in pieces of as many rows;
    with ``like``, over the stretches of other evidence of the same log.
    """

    shown: list[str]
    sigma: dict[str, float]
    folds: Mapping[str, float]
    """Readings whose sign is lost, with the share of it: the simulator follows the log once that is taken away."""

    def __init__(
        self, log: PortLog, simulator: Simulator, whole: bool = False, refit: bool = False, lines: bool = False,
        longest: int = 0, like: StretchEvidence | None = None,
    ) -> None:  # fmt: skip
        super().__init__(log, simulator, refit, lines)
        self.whole, self.longest, self.like = whole, longest, like
        self.stretches: list[Segment] = []
        self.folds = {}
        self._along_loops: np.ndarray | None = None
        self._x0 = np.zeros((len(simulator.states), 0))
        self._moved: dict[tuple[str, ...], np.ndarray] = {}
        self._round: dict[str, float] = {}
        self._moves: dict[str, str] = {}
        """Hidden velocities, with the positions that show them."""
        if simulator.form == "ode" and simulator.states:
            self._round = full_turns(simulator, *probe(simulator, log))
            hidden = {v: x for x, v in pairs_of(simulator, log).items() if x in log.channels}
            self._moves = {v: x for v, x in hidden.items() if v not in log.channels}
        self._guess = np.array([simulator.port(s).begins for s in simulator.states])

    @abstractmethod
    def _predict_many(self, starts: Sequence[np.ndarray], numbers: Sequence[np.ndarray]) -> list[list[np.ndarray]]:
        """Return the predicted channels for several initial states and numbers, (n_shown, length) per stretch."""

    def _lay(self) -> None:
        """Choose the longest stretches that the simulator can follow, and fit their initial states."""
        if self.like is not None:
            self._lay_like(self.like)
            return
        longest = self._needed()
        best: tuple[float, list[Segment], np.ndarray] | None = None
        length, rising = longest, False
        while True:
            self.stretches = self._cut(length)
            x0 = self._starts()
            error = self._error(x0)
            if not self._runs_away(error):
                x0 = self._fitted_starts()
                error = self._error(x0)
            missed = self._missed(error)
            if FOLLOWS <= missed < ASTRAY and length == longest and self.free and self.refit:
                there, x, others = self._refitted(x0)
                if there < FOLLOWS:
                    self._begin_from(x)
                    missed, x0 = there, others
            if FOLLOWS <= missed < ASTRAY and length == longest and not self.whole:
                missed, x0 = self._without_sign() or (missed, x0)
            follows = missed < FOLLOWS
            if best is None or follows or (not rising and missed < 0.7 * best[0]):
                best = missed, self.stretches, x0
            if self.simulator.form == "run" or self.whole or (follows if length == longest else rising and not follows):
                break
            if follows:  # where the length was guessed, twice as much may work
                rising, length = True, 2 * length
                if length > longest // 2:
                    break
                continue
            if length // 2 < SHORTEST:
                break
            # Predictions that diverge at once are not retried over ever shorter stretches.
            length = min(length // 2, max(SHORTEST, GOES * self._followed(error)))
        _, self.stretches, self._x0 = best
        self._part()
        self.laid = self._x0
        lengths = [s.stop - s.first for s in self.stretches]
        whole, most = len(lengths) == len(self.log.spans), "up to " if 2 * min(lengths) <= max(lengths) else ""
        pieces = "whole runs" if whole else f"stretches of {most}{max(lengths) * self.log.dt:.3g} s"
        held = self.simulator.form == "ode" and all(name in self.log.channels for name in self.simulator.states)
        noisy = "since noise in the logged states would bias parameters" if self.longest else "not of the logged states"
        why = noisy if held else "since the log lacks states"
        self.how = f"of predictions over {pieces}, each from an initial state fitted to it, {why}"

    def _part(self) -> None:
        """Halve the stretches whose readings do not tell well enough where they begin.

        Least squares from there has many least values, and first order says nothing of any change.
        """
        while self.simulator.form == "ode" and not self.whole:
            led = self._led_elsewhere()
            bent = [b and s.stop - s.first >= 2 * SHORTEST for b, s in zip(led, self.stretches, strict=True)]
            if not any(bent):
                break
            halves = [(s, (s.first + s.stop) // 2) for s in self.stretches]
            parts = [
                [Segment(s.first, middle), Segment(middle, s.stop)] if b else [s]
                for b, (s, middle) in zip(bent, halves, strict=True)
            ]
            self.stretches = [part for both in parts for part in both]
            self._x0 = self._fitted_starts()

    def _led_elsewhere(self) -> list[bool]:
        """Return the stretches whose prediction is far from linear in a start that is off by its reading's noise."""
        off = np.array([self.sigma.get(s, 0.0) if s in self.log.channels else 0.0 for s in self.simulator.states])
        starts = [self._x0 + sign * h[:, None] for h in np.diag(off) if h.any() for sign in (1.0, -1.0)]
        here, *there = self._errors([self._x0, *starts], [self.simulator.numbers] * (len(starts) + 1))
        least = np.array([FOLLOWS * self._spread(n) / self.sigma[n] for n in self.shown])
        bent = [False] * len(here)
        for ahead, behind in zip(there[::2], there[1::2], strict=True):
            for k, (a, b, e) in enumerate(zip(ahead, behind, here, strict=True)):
                size = np.sqrt(np.mean(np.square(0.5 * (a + b) - e), axis=1))
                bent[k] = bent[k] or not bool(np.all(size < least))
        return bent

    def _lay_like(self, other: StretchEvidence) -> None:
        """Take the stretches of another evidence of the log, whose inputs differ only within samples."""
        self.folds, self.curved, self.how, self.stretches = other.folds, other.curved, other.how, other.stretches
        self.simulator, self.about = other.simulator, other.about[: len(self.about)]
        self.laid = other.laid
        self._x0 = self._unless_apart(*self._fitted_from(self.laid))

    def _cut(self, length: int) -> list[Segment]:
        found = []
        for a, b in self.log.spans:
            count = max(1, round((b - a) / length))
            edges = np.linspace(a, b, count + 1).astype(int)
            found += [Segment(int(x), int(y)) for x, y in pairwise(edges)]
        return found

    def _needed(self) -> int:
        """Return the longest useful stretch: the longest run, or less where its initial state is forgotten.

        Stretches can then be simulated side by side.
        """
        longest = max(b - a for a, b in self.log.spans)
        if self.longest:
            return min(longest, self.longest)
        if self.simulator.form != "ode" or self.whole or not self.simulator.states:
            return longest
        for length in FORGETS:
            if length * AT_ONCE > longest:
                break
            self.stretches = self._cut(length)
            if all(forgotten(slopes) for slopes in self._slopes(self._starts())):
                return max(s.stop - s.first for s in self.stretches)
        return longest

    def _starts(self) -> np.ndarray:
        """Return first guesses of the initial states: measured values and speeds, else the start of runs."""
        x0 = np.repeat(self._guess[:, None], len(self.stretches), axis=1)
        for k, state in enumerate(self.simulator.states):
            if state in self.log.channels:
                x0[k] = [self.log.channels[state][s.first] for s in self.stretches]
            elif state in self._moves:
                x0[k] = [self._speed(self._moves[state], s, x0[k, j]) for j, s in enumerate(self.stretches)]
        return self._closed(x0)

    def _closed(self, x0: np.ndarray) -> np.ndarray:
        """Return first guesses that leave no loop of the simulator open: joints that the log lacks follow the others.

        Of several ways to close a loop, it is the one that leads on from the start of the model.
        """
        simulator, log = self.simulator, self.log
        known = {s for s in simulator.states if s in log.channels or s in self._moves}
        if simulator.closed(x0, known) is x0:
            return x0
        if self._along_loops is None:
            own = zip(simulator.states, self._guess, strict=True)
            x = np.stack([log.channels.get(s, np.full(log.n, begin)) for s, begin in own])
            self._along_loops = np.hstack([simulator.closed(x[:, a:b], known, along=True) for a, b in log.spans])
        hidden = [s not in known for s in simulator.states]
        firsts = [s.first for s in self.stretches]
        guess = np.where(np.array(hidden)[:, None], self._along_loops[:, firsts], x0)
        return simulator.closed(guess, known)

    def _speed(self, position: str, s: Segment, otherwise: float) -> float:
        """Return how fast a stretch begins: over the first rows in which it moves by clearly more than the noise."""
        way = self.log.channels[position][s.first : s.stop] - self.log.channels[position][s.first]
        rows = int(np.argmax(np.abs(way) > BELOW * self.sigma[position]))
        return float(way[rows]) / (rows * self.log.dt) if rows else otherwise

    def _fitted_starts(self) -> np.ndarray:
        x0 = self._starts()
        if not len(x0):
            return x0
        found, error = self._fitted_from(x0)
        mirrored = x0 * np.where([s in self.folds for s in self.simulator.states], -1.0, 1.0)[:, None]
        if np.any(mirrored != x0):  # a magnitude does not show on which side a stretch begins
            others, missed = self._fitted_from(mirrored)
            better = [power([m]) < power([e]) for m, e in zip(missed, error, strict=True)]
            found, error = (
                np.where(better, others, found),
                [m if b else e for m, e, b in zip(missed, error, better, strict=True)],
            )
        return self._unless_apart(found, error)

    def _unless_apart(self, x0: np.ndarray, error: list[np.ndarray]) -> np.ndarray:
        """Return initial states, fitted anew over growing parts where a stretch misses by far more than the others.

        Far along an unstable motion the error has many least values, and few over its first part.
        """
        misses = [rms(np.nan_to_num(e)) for e in error]
        least = max(min(misses) if len(misses) > 1 else 1.0, 1.0)
        if self.simulator.one_by_one or max(misses) <= APART * least:
            return x0
        anew = self._starts()
        for share in FIRST_PARTS:
            anew, _ = self._fitted_from(anew, share)
        anew, missed = self._fitted_from(anew)
        better = [power([m]) < power([e]) for m, e in zip(missed, error, strict=True)]
        return np.where(better, anew, x0)

    def _fitted_from(self, x0: np.ndarray, share: float = 1.0) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the best initial states near given ones, and the error over a first share of each stretch."""

        def begun(along: Sequence[np.ndarray]) -> list[np.ndarray]:
            return [x[..., : max(round(share * x.shape[-1]), 1)] for x in along]

        error = begun(self._error(x0))
        for _ in range(ROUNDS if len(x0) else 0):
            shift = self._shift(begun(self._slopes(x0)), error)
            for size in (1.0,) if share == 1.0 else (1.0, 0.25, 0.0625):
                trial = x0 + size * shift
                found = begun(self._error(trial))
                less = [np.sum(np.square(f)) < np.sum(np.square(e)) for f, e in zip(found, error, strict=True)]
                better = np.array(less)
                if better.any():
                    break
            if not better.any():
                break
            x0, before = np.where(better, trial, x0), power(error)
            error = [f if b else e for f, e, b in zip(found, error, better, strict=True)]
            if before - power(error) < len(x0):  # no more than noise alone would make of as many initial states
                break
        return x0, error

    def _without_sign(self) -> tuple[float, np.ndarray] | None:
        """Return prediction errors with a reading without its sign, and initial states; None if not smaller.

        A reading that is never negative, where the prediction is, may be a magnitude. Then no initial state lets the
        simulator follow it, and very short stretches would hide the sensor fault.
        """
        plain = np.concatenate(self._predict_many([self._starts()], [self.simulator.numbers])[0], axis=1)
        for name, row in zip(self.shown, plain, strict=True):
            x = self.log.channels[name]
            if np.min(x) < -BELOW * self.sigma[name] or not np.min(row) < -FOLLOWS * float(np.std(x)):
                continue
            for share in LOST:
                self.folds = {name: share}
                x0 = self._fitted_starts()
                missed = self._missed(self._error(x0))
                if missed >= FOLLOWS and self.free and self.refit:
                    missed, d, x0 = self._refitted(x0)
                    if missed < FOLLOWS:
                        self._begin_from(d)
                if missed < FOLLOWS:
                    self.curved = True  # sensitivities change sign with the reading
                    return missed, x0
        self.folds = {}
        return None

    def _fold(self, rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return predicted channels without the lost signs."""
        lost = np.array([self.folds.get(n, 0.0) for n in self.shown])[:, None]
        return [y + lost * (np.abs(y) - y) for y in rows] if self.folds else list(rows)

    def _refitted(self, x0: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Return prediction errors once tolerances are fitted with the initial states, and both.

        A simulator with poorly known numbers may follow a log only with other values. Levenberg–Marquardt, with the
        initial states projected out.
        """
        x, d, damping, first = x0, np.zeros(len(self.free)), 1e-2, None
        error = self._error(x)
        for _ in range(LAYINGS):
            slopes = self._slopes(x, self._numbers_at(d))
            columns = [c.reshape(len(d), -1) for c in self._slopes_of_numbers(x, d)]
            A = np.concatenate([beside(slopes[k], c) for k, c in enumerate(columns)], axis=1)
            left = np.concatenate([beside(slopes[k], e.reshape(1, -1))[0] for k, e in enumerate(error)])
            first = A if first is None else first
            size = np.sqrt(np.sum(np.square(A), axis=1))
            size = np.where(size > 0.0, size, 1.0)  # a number that acts on nothing stays where it is
            # Tolerances have the same prior as in fits: parameters with little influence stay near their values.
            prior = TOLERANCE * power(error) / sum(e.size for e in error)
            for _ in range(4):
                H = (A / size[:, None]) @ (A / size[:, None]).T + np.diag(damping + prior / size**2)
                trial = d + bounded(H, (A @ left - prior * d) / size, (-1.0 - d) * size, (1.0 - d) * size) / size
                changed = [
                    np.tensordot(trial - d, c, axes=1).reshape(e.shape) for c, e in zip(columns, error, strict=True)
                ]
                rest = [e - c for e, c in zip(error, changed, strict=True)]
                start = x + self._shift(slopes, rest)
                found = self._error(start, self._numbers_at(trial))
                if power(found) < power(error):
                    break
                damping *= 10.0
            else:
                break
            gain, x, d, error = 1.0 - power(found) / power(error), start, trial, found
            self.curved = self.curved or differ(first, A)
            damping *= 0.1
            if gain < 0.01:
                break
        return self._missed(error), d, x

    def _numbers_at(self, x: np.ndarray) -> np.ndarray:
        return self.numbers(dict(zip(self.free, map(float, x), strict=True)))

    def _runs_away(self, error: list[np.ndarray]) -> bool:
        """Return whether predictions leave the measurements long before their end, whatever the initial state."""
        if self.simulator.form == "run" or self.whole:
            return False
        return self._missed(error) > ASTRAY and GOES * self._followed(error) < max(e.shape[1] for e in error)

    def _followed(self, error: list[np.ndarray]) -> int:
        """Return for how many samples predictions usually follow the log."""
        most = np.array([FOLLOWS * self._spread(n) / self.sigma[n] for n in self.shown])
        astray = [np.flatnonzero(np.any(~(np.abs(e) <= most[:, None]), axis=0)) for e in error]
        return int(np.median([a[0] if len(a) else e.shape[1] for a, e in zip(astray, error, strict=True)]))

    def _spread(self, name: str) -> float:
        """Return a signal's deviation; of an angle in which the simulator comes round, at most that within a turn.

        A pendulum that whirls is somewhere else long before it misses half of all turns that it made.
        """
        return min(float(np.std(self.log.channels[name])) or 1.0, self._round.get(name, np.inf) / np.sqrt(12.0))

    def _missed(self, error: list[np.ndarray]) -> float:
        """Return the largest prediction error as a share of a signal's deviation."""
        worst = 0.0
        for row, name in zip(np.concatenate(error, axis=1), self.shown, strict=True):
            size = self._spread(name)
            worst = max(worst, float(np.sqrt(np.mean(np.square(row)))) * self.sigma[name] / size)
        return worst if np.isfinite(worst) else np.inf

    def _error(self, x0: np.ndarray, numbers: np.ndarray | None = None) -> list[np.ndarray]:
        """Return prediction errors, in units of each channel's noise, shape (n_shown, length) per stretch."""
        return self._errors([x0], [self.simulator.numbers if numbers is None else numbers])[0]

    def _errors(self, starts: Sequence[np.ndarray], numbers: Sequence[np.ndarray]) -> list[list[np.ndarray]]:
        """Return the same for several initial states and numbers, which are simulated together."""
        sigma = np.array([self.sigma[n] for n in self.shown])[:, None]
        measured = [np.stack([self.log.channels[n][s.first : s.stop] for n in self.shown]) for s in self.stretches]
        return [
            [(y - rows) / sigma for y, rows in zip(measured, self._fold(predicted), strict=True)]
            for predicted in self._predict_many(starts, numbers)
        ]

    def _slopes(self, x0: np.ndarray, numbers: np.ndarray | None = None) -> list[np.ndarray]:
        """Return the sensitivities of predictions to initial states, in noise, shape (n_states, n_shown, length)."""
        numbers = self.simulator.numbers if numbers is None else numbers
        steps = [1e-4 * (float(np.max(np.abs(row))) or 1.0) for row in x0]
        starts = [x0 + h * e[:, None] for h, e in zip(steps, np.eye(len(x0)), strict=True)]
        base, *moved = self._errors([x0, *starts], [numbers] * (len(x0) + 1))
        return [
            np.stack([(base[j] - m[j]) / h for m, h in zip(moved, steps, strict=True)])
            if steps
            else np.zeros((0, *base[j].shape))
            for j in range(len(base))
        ]

    def _slopes_of_numbers(self, x0: np.ndarray, d: np.ndarray) -> list[np.ndarray]:
        """Return the sensitivities of predictions to tolerances, in noise, shape (n_free, n_shown, length)."""
        steps = [self._numbers_at(d), *(self._numbers_at(d + e) for e in 0.01 * np.eye(len(d)))]
        base, *there = self._errors([x0] * len(steps), steps)
        return [np.stack([(base[j] - m[j]) / 0.01 for m in there]) for j in range(len(base))]

    def _shift(self, slopes: list[np.ndarray], error: list[np.ndarray]) -> np.ndarray:
        """Return the changes of the initial states that explain most, shape (n_states, n_stretches)."""
        columns = []
        for slope, e in zip(slopes, error, strict=True):
            A = slope.reshape(len(slope), math.prod(slope.shape[1:]))
            size = np.sqrt(np.sum(np.square(A), axis=1))
            size = np.where(size > 0.0, size, 1.0)
            if not np.all(np.isfinite(A)):  # the simulator goes where it has no values: told elsewhere
                columns.append(np.full(len(A), np.nan))
                continue
            # Of an unstable motion all states soon act alike: normal equations would lose what sets them apart.
            columns.append(np.linalg.lstsq((A / size[:, None]).T, np.nan_to_num(e).ravel(), rcond=1e-10)[0] / size)
        return np.stack(columns, axis=1) if columns else np.zeros((0, 0))


def forgotten(slopes: np.ndarray) -> bool:
    """Return whether the effect of initial states, shape (n_states, n_shown, n), has died out halfway along."""
    size = np.max(np.abs(slopes), axis=1)
    return bool(np.all(np.max(size[:, size.shape[1] // 2 :], axis=1) <= GONE * np.max(size, axis=1)))


def beside(slopes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return rows with the initial states projected out."""
    O = slopes.reshape(len(slopes), math.prod(slopes.shape[1:]))  # noqa: E741 - as in the module's formula
    size = np.sqrt(np.sum(np.square(O), axis=1))
    Q = np.linalg.qr((O[size > 0.0] / size[size > 0.0, None]).T)[0]
    return rows - (rows @ Q) @ Q.T


def power(parts: Sequence[np.ndarray]) -> float:
    """Return the sum of all squares."""
    return float(sum(np.sum(np.square(x)) for x in parts))

"""Stretches of a log that a simulator can follow, and their best initial states."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np

from ...simulators.base import Simulator
from ...simulators.port_log import PortLog
from ...simulators.structure import full_turns
from ..inference.student_t import bounded
from ..settings import TOLERANCE
from .influence import Influence, beside, forgotten
from .ports import PortEvidence
from .recalled import Recalled, recalled
from .segments import SHORTEST, Segment, cut
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
BELOW = 6.0
"""Standard deviations of the noise below zero that a reading without a sign may be."""
LOST = 1.0, 0.5
"""Shares of the sign that a sensor may not read: a magnitude, and half of the range."""
FORGETS, AT_ONCE = (500, 2000, 8000), 8
"""Lengths over which it is asked whether a simulator forgets where it began, and how many such stretches make it worth
while."""


class StretchEvidence(PortEvidence):
    """What predictions over stretches of a log need: their bounds and initial states.

    With ``whole``, runs are predicted as wholes, however far they diverge; with ``longest``, in pieces of as many rows;
    with ``like``, over the stretches of other evidence of the same log, or over their ``halves``.
    """

    shown: list[str]
    sigma: dict[str, float]
    folds: Mapping[str, float]
    """Readings whose sign is lost, with the share of it: the simulator follows the log once that is taken away."""

    def __init__(
        self, log: PortLog, simulator: Simulator, whole: bool = False, refit: bool = False, lines: bool = False,
        longest: int = 0, like: StretchEvidence | None = None, halves: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(log, simulator, refit, lines)
        self.whole, self.longest, self.like, self.halves = whole, longest, like, halves
        self.stretches: list[Segment] = []
        self.folds = {}
        self._along_loops: np.ndarray | None = None
        self._recalled = Recalled.nothing(log.n)
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

    @property
    def _firsts(self) -> np.ndarray:
        """First rows of the stretches, which follow each other."""
        return np.array([s.first for s in self.stretches])

    @property
    def _of(self) -> np.ndarray:
        """Return the stretch of each row."""
        return np.repeat(np.arange(len(self.stretches)), np.diff(np.append(self._firsts, self.log.n)))

    def _sums(self, rows: np.ndarray) -> np.ndarray:
        """Return the sums of rows over each stretch."""
        return np.add.reduceat(rows, self._firsts, axis=-1)

    @property
    @abstractmethod
    def along(self) -> np.ndarray:
        """The states along the log from the fitted initial states, shape (n_states, n)."""

    @abstractmethod
    def _predict_many(self, starts: Sequence[np.ndarray], numbers: Sequence[np.ndarray]) -> np.ndarray:
        """Return the predicted channels for several initial states and numbers, shape (n_copies, n_shown, n)."""

    @abstractmethod
    def _states_from(self, x0: np.ndarray, numbers: np.ndarray | None = None) -> np.ndarray:
        """Return the states along the log from initial states, without effects."""

    @abstractmethod
    def _arrived(self, x0: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the states along the log, and where each stretch begins if it goes on from the one before it."""

    def _lay(self) -> None:
        """Choose the longest stretches that the simulator can follow, and fit their initial states."""
        if self.like is not None:
            self._lay_like(self.like)
            return
        longest = self._needed()
        best: tuple[float, list[Segment], np.ndarray] | None = None
        length, rising, fits = longest, False, bool(self.free) and self.refit
        while True:
            self.stretches = cut(self.log.spans, length)
            x0 = self._starts()
            error = self._error(x0)
            if not self._runs_away(error):
                x0 = self._fitted_starts()
                error = self._error(x0)
            missed = self._off(x0, error)
            if FOLLOWS <= missed < ASTRAY and fits and not rising:
                fits = False  # at the longest that comes near: over shorter ones tolerances, too, take up a gap
                there, x, others = self._refitted(x0)
                if there < FOLLOWS:
                    self._begin_from(x)
                    x0 = others
                missed = min(missed, there)
            if FOLLOWS <= missed < ASTRAY and length == longest and not self.whole:
                missed, x0 = self._without_sign() or (missed, x0)
            follows = missed < FOLLOWS
            if best is None or follows or (missed < 0.7 * best[0] if not rising else self._hidden_by(best, error)):
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
            if length == longest:
                self._recall()
            # Predictions that diverge at once are not retried over ever shorter stretches.
            length = min(length // 2, max(SHORTEST, GOES * self._followed(error)))
        _, self.stretches, self._x0 = best
        self._part()
        self.laid = self._x0
        self._tell_how()

    def _hidden_by(self, shorter: tuple[float, list[Segment], np.ndarray], error: np.ndarray) -> bool:
        """Return whether the starts of shorter stretches take up a gap that shows in the readings of these."""
        if not max(self._missed(error), self._missed(error[:, self._firsts])) < FOLLOWS:
            return False
        _, stretches, x0 = shorter
        with self._over(stretches):
            left = rms(self._error(x0))
            return left < 2.0 and self._torn(x0, self.simulator.numbers, left) > 0.0

    def _recall(self) -> None:
        """Take from whole runs what they tell of hidden states."""
        shown = {*self.shown, *self._moves}
        hidden = [k for k, s in enumerate(self.simulator.states) if s not in shown]
        if hidden:
            with self._over(cut(self.log.spans, self.log.n)):
                self._recalled = recalled(self._states_from, self._starts(), hidden, self.log.spans)

    @contextmanager
    def _over(self, stretches: list[Segment]) -> Iterator[None]:
        """Predict over other stretches for a while."""
        kept, self.stretches = self.stretches, stretches
        try:
            yield
        finally:
            self.stretches = kept

    def _tell_how(self) -> None:
        lengths = [s.stop - s.first for s in self.stretches]
        whole, most = len(lengths) == len(self.log.spans), "up to " if 2 * min(lengths) <= max(lengths) else ""
        pieces = "whole runs" if whole else f"stretches of {most}{max(lengths) * self.log.dt:.3g} s"
        held = self.simulator.form == "ode" and all(name in self.log.channels for name in self.simulator.states)
        noisy = "since noise in the logged states would bias parameters" if self.longest else "not from the logged one"
        why = noisy if held else "since the log lacks states"
        self.how = f"of predictions over {pieces}, each from a fitted initial state, {why}"

    def _part(self) -> None:
        """Halve the stretches whose readings do not tell well enough where they begin."""
        while self.simulator.form == "ode" and not self.whole:
            led = self._led_elsewhere()
            bent = [b and s.stop - s.first >= 2 * SHORTEST for b, s in zip(led, self.stretches, strict=True)]
            if not any(bent):
                break
            parts = [s.halves if b else [s] for b, s in zip(bent, self.stretches, strict=True)]
            self.stretches = [part for both in parts for part in both]
            self._x0 = self._fitted_starts()

    def _led_elsewhere(self) -> np.ndarray:
        """Return the stretches whose prediction is far from linear in a start that is off by its reading's noise."""
        off = np.array([self.sigma.get(s, 0.0) if s in self.log.channels else 0.0 for s in self.simulator.states])
        starts = [self._x0 + sign * h[:, None] for h in np.diag(off) if h.any() for sign in (1.0, -1.0)]
        here, *there = self._errors([self._x0, *starts], [self.simulator.numbers] * (len(starts) + 1))
        least = np.array([FOLLOWS * self._spread(n) / self.sigma[n] for n in self.shown])
        bent = np.zeros(len(self.stretches), dtype=bool)
        for ahead, behind in zip(there[::2], there[1::2], strict=True):
            power = self._sums(np.square(0.5 * (ahead + behind) - here)) / np.bincount(self._of)
            bent |= ~np.all(np.sqrt(power) < least[:, None], axis=0)
        return bent

    def _lay_like(self, other: StretchEvidence) -> None:
        """Take the stretches of other evidence or their halves, and its parameters if it is of the same simulator."""
        self.folds, self.curved, self.stretches = other.folds, other.curved, other.stretches
        self._recalled = other._recalled
        if other.given is self.given:
            self.simulator, self.about = other.simulator, other.about[: len(self.about)]
        self.laid = other.laid
        if self.halves:
            self.stretches = [half for s in self.stretches for half in s.halves]
            passed, self.laid = other.along[:, self._firsts], self._starts()  # where a motion goes on, or is read
            error, read = (self._power(self._error(x)) for x in (passed, self.laid))
            self.laid = np.where(error < read, passed, self.laid)
        self._x0 = self._unless_apart(*self._fitted_from(self.laid))
        if other.given is not self.given:  # which has effects that the other one tried
            self._moved = {kind: other._x0 + moved - self._x0 for kind, moved in other._moved.items()}
        self._tell_how()

    def _needed(self) -> int:
        """Return the longest useful stretch: the longest run, or less where its initial state is forgotten."""
        longest = max(b - a for a, b in self.log.spans)
        if self.longest:
            return min(longest, self.longest)
        if self.simulator.form != "ode" or self.whole or not self.simulator.states:
            return longest
        for length in FORGETS:
            if length * AT_ONCE > longest:
                break
            self.stretches = cut(self.log.spans, length)
            if all(map(forgotten, np.split(self._slopes(self._starts()), self._firsts[1:], axis=-1))):
                return max(s.stop - s.first for s in self.stretches)
        return longest

    def _starts(self) -> np.ndarray:
        """Return first guesses of the initial states: measured values and speeds, else the start of runs."""
        x0 = np.repeat(self._guess[:, None], len(self.stretches), axis=1)
        for k, state in enumerate(self.simulator.states):
            if state in self.log.channels:
                x0[k] = self.log.channels[state][self._firsts]
            elif state in self._moves:
                x0[k] = [self._speed(self._moves[state], s, x0[k, j]) for j, s in enumerate(self.stretches)]
        return self._closed(self._recalled.begun(x0, self._firsts))

    def _closed(self, x0: np.ndarray) -> np.ndarray:
        """Return first guesses with all loops closed, joints that the log lacks led on from the model's start."""
        simulator, log = self.simulator, self.log
        known = {s for s in simulator.states if s in log.channels or s in self._moves}
        if simulator.closed(x0, known) is x0:
            return x0
        if self._along_loops is None:
            own = zip(simulator.states, self._guess, strict=True)
            x = np.stack([log.channels.get(s, np.full(log.n, begin)) for s, begin in own])
            self._along_loops = np.hstack([simulator.closed(x[:, a:b], known, along=True) for a, b in log.spans])
        hidden = [s not in known for s in simulator.states]
        guess = np.where(np.array(hidden)[:, None], self._along_loops[:, self._firsts], x0)
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
            better = self._power(missed) < self._power(error)
            found, error = np.where(better, others, found), np.where(better[self._of], missed, error)
        return self._unless_apart(found, error)

    def _power(self, error: np.ndarray) -> np.ndarray:
        """Return the sum of squares over each stretch."""
        return self._sums(np.sum(np.square(error), axis=0))

    def _unless_apart(self, x0: np.ndarray, error: np.ndarray) -> np.ndarray:
        """Return initial states, fitted anew over growing parts where a stretch misses by far more than others."""
        # Far along an unstable motion the error has many least values, and few over its first part.
        misses = np.sqrt(self._power(np.nan_to_num(error)) / (len(error) * np.bincount(self._of)))
        least = max(np.min(misses) if len(misses) > 1 else 1.0, 1.0)
        if self.simulator.one_by_one or np.max(misses) <= APART * least:
            return x0
        anew = self._starts()
        for share in FIRST_PARTS:
            anew, _ = self._fitted_from(anew, share)
        anew, missed = self._fitted_from(anew)
        return np.where(self._power(missed) < self._power(error), anew, x0)

    def _fitted_from(self, x0: np.ndarray, share: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the best initial states near given ones over a first share of each stretch, and the error."""
        within = [np.arange(s.first, s.first + max(round(share * (s.stop - s.first)), 1)) for s in self.stretches]
        rows = np.concatenate(within)
        of = self._of[rows]

        def power(left: np.ndarray) -> np.ndarray:
            return np.bincount(of, np.sum(np.square(left[:, rows]), axis=0))

        error = self._error(x0)
        for _ in range(ROUNDS if len(x0) else 0):
            as_off = rms(error[:, rows])
            missing = self._missing(error, x0, as_off)
            influence = Influence(self._leading(x0, as_off)[..., rows], of, len(self.stretches))
            shift, before = influence.explained(missing[:, rows]), power(missing)
            for size in (1.0,) if share == 1.0 else (1.0, 0.25, 0.0625):
                trial = x0 + size * shift
                found = self._error(trial)
                after = power(self._missing(found, trial, as_off))
                better = after < before
                if better.any():
                    break
            if not better.any():
                break
            x0, error = np.where(better, trial, x0), np.where(better[self._of], found, error)
            if np.sum((before - after)[better]) < len(x0):  # as noise alone makes of as many initial states
                break
        return x0, error

    def _without_sign(self) -> tuple[float, np.ndarray] | None:
        """Return prediction errors of a reading taken as a magnitude, and initial states; None if not smaller."""
        # From no initial state the simulator follows one, and very short stretches would hide the sensor's fault.
        plain = self._predict_many([self._starts()], [self.simulator.numbers])[0]
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

    def _fold(self, rows: np.ndarray) -> np.ndarray:
        """Return predicted channels without the lost signs."""
        lost = np.array([self.folds.get(n, 0.0) for n in self.shown])[:, None]
        return rows + lost * (np.abs(rows) - rows) if self.folds else rows

    def _refitted(self, x0: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Return prediction errors once tolerances are fitted, initial states projected out of each step, and both."""
        x, d, damping, first = x0, np.zeros(len(self.free)), 1e-2, None
        error = self._error(x)
        for _ in range(LAYINGS):
            as_off = rms(error)
            missing, slopes = self._missing(error, x, as_off), self._leading(x, as_off, self._numbers_at(d))
            columns = self._slopes_of_numbers(x, d)
            columns = np.pad(columns, ((0, 0), (0, len(missing) - columns.shape[1]), (0, 0)))
            parts = [slice(s.first, s.stop) for s in self.stretches]
            flat = [(slopes[..., p], columns[..., p].reshape(len(d), -1), missing[:, p].reshape(1, -1)) for p in parts]
            A = np.concatenate([beside(own, c) for own, c, _ in flat], axis=1)
            left = np.concatenate([beside(own, e)[0] for own, _, e in flat])
            first = A if first is None else first
            size = np.sqrt(np.sum(np.square(A), axis=1))
            size = np.where(size > 0.0, size, 1.0)  # a number that acts on nothing stays where it is
            # Tolerances have the same prior as in fits: parameters with little influence stay near their values.
            before = float(np.sum(np.square(missing)))
            prior, begun = TOLERANCE * before / missing.size, Influence(slopes, self._of, len(self.stretches))
            for _ in range(4):
                H = (A / size[:, None]) @ (A / size[:, None]).T + np.diag(damping + prior / size**2)
                trial = d + bounded(H, (A @ left - prior * d) / size, (-1.0 - d) * size, (1.0 - d) * size) / size
                start = x + begun.explained(missing - np.tensordot(trial - d, columns, axes=1))
                found = self._error(start, self._numbers_at(trial))
                after = float(np.sum(np.square(self._missing(found, start, as_off))))
                if after < before:
                    break
                damping *= 10.0
            else:
                break
            x, d, error = start, trial, found
            self.curved = self.curved or differ(first, A)
            damping *= 0.1
            if 1.0 - after / before < 0.01:
                break
        return self._off(x, error, self._numbers_at(d)), d, x

    def _numbers_at(self, x: np.ndarray) -> np.ndarray:
        return self.numbers(dict(zip(self.free, map(float, x), strict=True)))

    def _runs_away(self, error: np.ndarray) -> bool:
        """Return whether predictions leave the measurements long before their end, whatever the initial state."""
        if self.simulator.form == "run" or self.whole:
            return False
        return bool(self._missed(error) > ASTRAY and GOES * self._followed(error) < np.max(np.bincount(self._of)))

    def _followed(self, error: np.ndarray) -> int:
        """Return for how many samples predictions usually follow the log."""
        most = np.array([FOLLOWS * self._spread(n) / self.sigma[n] for n in self.shown])
        astray = np.split(np.any(~(np.abs(error) <= most[:, None]), axis=0), self._firsts[1:])
        return int(np.median([np.argmax(a) if a.any() else len(a) for a in astray]))

    def _spread(self, name: str) -> float:
        """Return a signal's deviation; of an angle in which the simulator comes round, at most that within a turn."""
        return min(float(np.std(self.log.channels[name])) or 1.0, self._full_turn(name))

    def _full_turn(self, name: str) -> float:
        """Return the deviation of an angle within a turn in which the simulator comes round; infinity of others."""
        return float(self._round.get(name, np.inf) / np.sqrt(12.0))

    def _missed(self, error: np.ndarray) -> float:
        """Return the largest prediction error as a share of a signal's deviation."""
        worst = 0.0
        for row, name in zip(error, self.shown, strict=True):
            size = self._spread(name)
            worst = max(worst, float(np.sqrt(np.mean(np.square(row)))) * self.sigma[name] / size)
        return worst if np.isfinite(worst) else np.inf

    def _off(self, x0: np.ndarray, error: np.ndarray, numbers: np.ndarray | None = None) -> float:
        """Return the largest error of predictions, or of where they begin, as a share of a signal's deviation."""
        # A gap adds up along a stretch, and the fit of initial states moves where it begins instead.
        missed = self._missed(error)
        if self.simulator.form != "ode" or not len(x0) or not missed < FOLLOWS:
            return missed
        torn = self._torn(x0, self.simulator.numbers if numbers is None else numbers, rms(error))
        return max(missed, self._missed(error[:, self._firsts]), torn)

    def _torn(self, x0: np.ndarray, numbers: np.ndarray, as_off: float) -> float:
        """Return how far stretches lead from where they would, did they go on from the one before, beyond noise."""
        on = np.diff(self.log.run[self._firsts]) == 0
        if not on.any():
            return 0.0
        states, arrived = self._arrived(x0, numbers)
        sizes = np.minimum(np.std(states, axis=1), [self._full_turn(n) for n in self.simulator.states])
        influence = Influence(self._leading(x0, as_off, numbers), self._of, len(self.stretches))
        # What is soon forgotten leads most of a stretch nowhere.
        led = self._states_from(x0 + influence.apart(arrived - x0, APART), numbers) - states
        pairs = zip(led[:, np.append(False, on)[self._of]], sizes, strict=True)
        return max((float(np.median(np.abs(row))) / size for row, size in pairs if size > 0.0), default=0.0)

    def _error(self, x0: np.ndarray, numbers: np.ndarray | None = None) -> np.ndarray:
        """Return prediction errors, in units of each channel's noise, shape (n_shown, n)."""
        return np.asarray(self._errors([x0], [self.simulator.numbers if numbers is None else numbers])[0])

    def _missing(self, error: np.ndarray, x0: np.ndarray, as_off: float) -> np.ndarray:
        """Return prediction errors, and how far initial states are from what is recalled of them.

        Errors that a gap makes `as_off` times as large as the noise must not outweigh that.
        """
        return np.vstack([error, max(as_off, 1.0) * self._recalled.error(x0, self._firsts)])

    def _leading(self, x0: np.ndarray, as_off: float, numbers: np.ndarray | None = None) -> np.ndarray:
        """Return the sensitivities of both to initial states."""
        known = max(as_off, 1.0) * self._recalled.slopes(len(x0), self._firsts)
        return np.concatenate([self._slopes(x0, numbers), known], axis=1)

    def _errors(self, starts: Sequence[np.ndarray], numbers: Sequence[np.ndarray]) -> np.ndarray:
        """Return the same for several initial states and numbers, which are simulated together."""
        return (self._readings(self.log.channels) - self._fold(self._predict_many(starts, numbers))) / self._scale

    def _readings(self, channels: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return what sensors read of the predicted channels."""
        return np.stack([channels[n] for n in self.shown])

    @property
    def _scale(self) -> np.ndarray:
        """Noise of each predicted channel, as a column."""
        return np.array([self.sigma[n] for n in self.shown])[:, None]

    def _slopes(self, x0: np.ndarray, numbers: np.ndarray | None = None) -> np.ndarray:
        """Return the sensitivities of predictions to initial states, in noise, shape (n_states, n_shown, n)."""
        numbers = self.simulator.numbers if numbers is None else numbers
        steps = np.array([1e-4 * (float(np.max(np.abs(row))) or 1.0) for row in x0])
        starts = [x0 + h * e[:, None] for h, e in zip(steps, np.eye(len(x0)), strict=True)]
        base, *moved = self._errors([x0, *starts], [numbers] * (len(x0) + 1))
        found = [(base - m) / h for m, h in zip(moved, steps, strict=True)]
        return np.reshape(found, (len(x0), *base.shape))

    def _slopes_of_numbers(self, x0: np.ndarray, d: np.ndarray) -> np.ndarray:
        """Return the sensitivities of predictions to tolerances, in noise, shape (n_free, n_shown, n)."""
        steps = [self._numbers_at(d), *(self._numbers_at(d + e) for e in 0.01 * np.eye(len(d)))]
        base, *there = self._errors([x0] * len(steps), steps)
        return np.stack([(base - m) / 0.01 for m in there])

"""Predictions of a simulator over stretches of a log, and their sensitivities; runs are cached."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from ...effects import Effect
from ...errors import SimulatorRunError
from ...remembered import Remembered
from ...signals.paths import steady_path
from ...simulators.accelerations import added_to_rates
from ...simulators.base import Simulator
from ...simulators.integrate import MOST, Runner, side_by_side
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog
from .between_rows import drawn, passed_on, read_between
from .influence import Influence
from .jumps import unknown_instants
from .protocol import Active, Spec
from .response import Drive, Response
from .segments import Segment
from .states import integral
from .stretches import FOLLOWS, StretchEvidence
from .superposed import Superposed
from .window_noise import REPLICATES

_PARTS = 10  # of a step, where a run goes with inputs in lines: the fastest states miss a twentieth of a step
MOST_RUNS = 200
"""Runs that are kept for the case that they are asked for again."""
MOST_RESPONSES = 6
"""The same of what runs respond to small changes."""
MOST_STATES = 12
"""The same of simulators of states, whose runs are larger: enough for readings that faults of sensors change."""


class PredictedEvidence(StretchEvidence):
    """Predictions over stretches, simulated where needed, else to first order about simulated ones."""

    overlap = 1

    def __init__(
        self, log: PortLog, simulator: Simulator, whole: bool = False, refit: bool = False, lines: bool = False,
        longest: int = 0, like: StretchEvidence | None = None, halves: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(log, simulator, whole, refit, lines, longest, like, halves)
        self.rough, self._u = simulator.form == "run", log.inputs(simulator)
        self.n = self.substeps = 1
        self._has_run = False
        self._felt = np.zeros((len(simulator.outputs), len(simulator.states)))
        """How many times outputs read the rates of states."""
        self._failed: tuple[int, list[str], int] | None = None
        self.simulated = 0.0
        self._kept_runs: dict[int, np.ndarray] = {}
        self._straight: tuple[list[Segment], np.ndarray] = [], np.zeros((0, 0))
        self._kept_states: Remembered[tuple[np.ndarray, np.ndarray]] = Remembered(MOST_STATES)
        self._responses: Remembered[Response] = Remembered(MOST_RESPONSES)
        self._along: dict[tuple[str, ...], np.ndarray] = {}
        """The latest states along the log, by the kind of change."""
        self._begins = np.zeros((0, 0, 0))
        """Sensitivities of predictions to initial states, shape (n_states, n_shown, n)."""
        self._read_speeds: dict[str, np.ndarray] = {}
        """Speeds of joints of which a log of readings holds the positions alone."""
        self._growths: Remembered[np.ndarray] = Remembered(MOST_RUNS)
        self._jumped: Remembered[tuple[np.ndarray, np.ndarray]] = Remembered(REPLICATES)
        self._done: dict[bytes, tuple[list[Superposed], list[np.ndarray]]] = {}

    def _asks_anew(self, deviations: Mapping[str, float]) -> dict[str, float]:
        """Return all deviations: initial states are fitted to each again."""
        return dict(deviations)

    def _predict(
        self, x0: np.ndarray, active: Active, numbers: np.ndarray, shown: Sequence[str] | None = None
    ) -> np.ndarray:
        """Return the predicted channels, shape (n_shown, n)."""
        shown = self.shown if shown is None else shown
        return self._read(active, self._unread(x0, active, numbers, shown), shown)

    def _unread(
        self, x0: np.ndarray, active: Active, numbers: np.ndarray, shown: Sequence[str] | None = None
    ) -> np.ndarray:
        """Return the same without the faults of sensors."""
        shown, drive = self.shown if shown is None else shown, self._drive(active, numbers)
        if self.simulator.form == "run":
            states, outputs = self._none, self._ran(x0, drive.u, drive.p)
        else:
            states, outputs = self._simulate(x0, drive.u, drive.p, drive.acting)
        return self._shown(states, outputs, shown)

    @property
    def _none(self) -> np.ndarray:
        """No state along the log."""
        return np.zeros((0, self.log.n))

    def _drive(self, active: Active, numbers: np.ndarray) -> Drive:
        """Return the inputs and parameters under effects, with effects that act like forces."""
        log, simulator = self.log, self.simulator
        u = passed_on(active, self._u, simulator.inputs, log, not self.lines)
        p = np.repeat(numbers[:, None], log.n, axis=1)
        for place, made in active:
            if place.enters == "parameter":
                p = place.adjusted(made, p, list(simulator.parameters), log.along, log.t)
            elif place.acts and simulator.form == "run":  # a force there depends on what the log reads
                u = u.copy()
                none = np.zeros((0, log.n))
                place.push(made, self._force(place, made), simulator, (log.t, none, u, p), u, none)
        return Drive(u, p, active, self.lines)

    def _read(self, active: Active, rows: np.ndarray, shown: Sequence[str]) -> np.ndarray:
        """Return channels as faulty sensors read them, in place."""
        for place, made in active:
            for k in [k for k, name in enumerate(shown) if name in place.readings]:
                rows[k] = read_between(place, made, rows[k], self.log.dt, self.log.starts)
        return rows

    def _predict_many(self, starts: Sequence[np.ndarray], numbers: Sequence[np.ndarray]) -> np.ndarray:
        """Return the predicted channels for several initial states and numbers, shape (n_copies, n_shown, n)."""
        if self.simulator.form != "ode":
            return np.stack([self._predict(x, [], p) for x, p in zip(starts, numbers, strict=True)])
        wide = [np.repeat(p[:, None], self.log.n, axis=1) for p in numbers]
        found = self._simulate_many(np.hstack(starts), self._u, np.stack(wide), [])
        return np.stack([self._shown(x, y, self.shown) for x, y in zip(*found, strict=True)])

    def _shown(self, states: np.ndarray, outputs: np.ndarray, shown: Sequence[str]) -> np.ndarray:
        """Return the requested channels of a simulation."""
        signals = dict(zip((*self.simulator.outputs, *self.simulator.states), (*outputs, *states), strict=False))
        return np.stack([np.asarray(signals[n], dtype=float) for n in shown])

    def _force(self, place: Placement, made: Effect) -> np.ndarray:
        """Return what an effect adds to an input along the log."""
        log, found = self.log, dict(self.log.channels) | self._read_speeds
        for name in place.sources() - set(found):
            found[name] = integral(found[self.speeds[name]], log)
        if place.link is not None:
            found |= place.link.across(found)
        for role, name in place.follows.items():
            if role == "position" and name not in self.speeds and place.effect.path_dependent:
                found[name] = steady_path(found[name], log.starts, self.sigma.get(name, 0.0), max(self.n, 5))
        s = place.signals(found, log.t)
        memory = made.trace(s, place.plant, log.dt * place.scales.time, log.starts)
        return np.broadcast_to(place.force(made, s, memory), (log.n,)).astype(float)

    def _ran(self, x0: np.ndarray, u: np.ndarray, p: np.ndarray, lines: bool | None = None) -> np.ndarray:
        """Return the outputs over all stretches, cached; what inputs in lines change is that of the first such runs."""
        key = hash((x0.tobytes(), u.tobytes(), p.tobytes()))
        if key not in self._kept_runs:
            if len(self._kept_runs) >= MOST_RUNS:
                self._kept_runs.clear()
            self._kept_runs[key] = self._run_stretches(x0, u, p, 1)
        found = self._kept_runs[key]
        if not (self.lines if lines is None else lines):
            return found
        if self._straight[0] != self.stretches:
            self._straight = self.stretches, self._run_stretches(x0, u, p, _PARTS) - found
        return found + self._straight[1]

    def _run_stretches(self, x0: np.ndarray, u: np.ndarray, p: np.ndarray, parts: int) -> np.ndarray:
        """Return the outputs over all stretches, inputs held over each of as many parts of a step."""
        t, found = self.log.t, np.zeros((len(self.simulator.outputs), self.log.n))
        lengths = np.array([s.stop - s.first for s in self.stretches])
        for length in np.unique(lengths):  # runs of one length are simulated together
            mine = np.flatnonzero(lengths == length)
            spans = [slice(self.stretches[k].first, self.stretches[k].stop) for k in mine]
            drive, numbers = np.stack([u[:, a] for a in spans]), np.stack([np.mean(p[:, a], axis=1) for a in spans])
            starts = x0.T[mine] if len(x0) else np.zeros((len(mine), 0))
            times = t[spans[0]] - t[spans[0]][0]
            times, drive = _in_parts(times, drive, parts) if parts > 1 else (times, drive)
            for span, y in zip(spans, self._asked_for(times, drive, numbers, starts), strict=True):
                found[:, span] = y[:, ::parts]
        self.simulated += parts
        return found

    def _asked_for(
        self, times: np.ndarray, drive: np.ndarray, numbers: np.ndarray, starts: np.ndarray
    ) -> Sequence[np.ndarray]:
        """Return the outputs of runs; where trial parameters end in an error, values unlike any log."""
        try:
            found = list(self.simulator.runs(times, drive, numbers, starts))
        except SimulatorRunError:
            if not self._has_run:
                raise  # as it was given, too
            return [np.full((len(self.simulator.outputs), len(times)), np.nan)] * len(drive)
        if not self._has_run:  # as it was given
            self._refuse_outputs(times, found)
        self._has_run = True
        return found

    def _refuse_outputs(self, times: np.ndarray, found: Sequence[np.ndarray]) -> None:
        """Raise where a run gives what is no number, or too large to be squared: a log cannot be compared with it."""
        for outputs in found:
            with np.errstate(over="ignore"):
                good = np.isfinite(np.square(outputs))
            if not good.all():
                k, at = np.argwhere(~good)[0]
                name = self.simulator.outputs[k]
                raise SimulatorRunError(
                    f"The simulator's output {name} is {outputs[k, at]:g} after {times[at]:.6g} s of a run.",
                    "finite numbers over each whole run",
                    "Correct the simulator, or its parameters and inputs.",
                )

    def _refuse_failure(self) -> None:
        """Raise where rates or outputs, as they were given, lead to what is no number: that predicts nothing."""
        simulator = self.simulator
        if simulator.form != "ode" or not simulator.states:
            return
        # Where the fitted initial states do not follow the log, either, the first ones tell why.
        follows = self._missed(self._error(self._x0)) < FOLLOWS
        for x0 in (self._x0,) if follows else (self._x0, self._starts()):
            p = np.repeat(simulator.numbers[:, None], self.log.n, axis=1)
            states, outputs = self._simulate(x0, self._u, p, [])
            if float(np.max(np.abs(states))) >= MOST:
                self._simulated(x0, self._u, p[None], [])  # one that is kept does not say where it failed
                if self._failed is not None:
                    row, failed, k = self._failed
                    self._refuse_run(", ".join(failed), "not finite", k, row + 1)
            if len(bad := np.argwhere(~np.isfinite(outputs.T))):
                at, output = bad[0]
                k = int(self._of[at])
                row = int(at) - self.stretches[k].first
                self._refuse_run(simulator.outputs[output], f"{outputs[output, at]:g}", k, row)

    def _refuse_run(self, what: str, value: str, stretch: int, row: int) -> None:
        first = self.stretches[stretch].first
        run = self.log.names[self.log.run[first]]
        raise SimulatorRunError(
            f"The simulator's prediction of {what} is {value} after {row * self.log.dt:.6g} s from "
            f"{self.log.t[first]:.6g} s of '{run}'. {self.simulator.undefined}",
            "finite rates and outputs in all states that a run reaches",
            "Correct the simulator, or its parameters and inputs.",
        )

    @property
    def along(self) -> np.ndarray:
        """The states along the log from the fitted initial states, shape (n_states, n)."""
        drive = self._drive(self._own, self.simulator.numbers)
        return self._simulate(self._x0, drive.u, drive.p, drive.acting)[0]

    def _states_from(self, x0: np.ndarray, numbers: np.ndarray | None = None) -> np.ndarray:
        """Return the states along the log from initial states, without effects."""
        numbers = self.simulator.numbers if numbers is None else numbers
        return self._simulate(x0, self._u, np.repeat(numbers[:, None], self.log.n, axis=1), [])[0]

    def _arrived(self, x0: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the states along the log, and where each stretch begins if it goes on from the one before it."""
        simulator, log, last = self.simulator, self.log, self._firsts[1:] - 1
        states = self._states_from(x0, numbers)
        runner = Runner(simulator, log.dt, (), self.substeps, self.lines)
        p, steps = np.repeat(numbers[:, None], len(last), axis=1), np.stack([last, last + 1])
        on = runner.states(log.t[steps], states[:, last], np.moveaxis(self._u[:, steps], 0, 1), p)[-1]
        return states, np.hstack([x0[:, :1], on])

    def _simulate(
        self, x0: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Active
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Return states and outputs along all stretches."""
        states, outputs = self._simulate_many(x0, u, p[None], acting)
        return states[0], outputs[0]

    def _simulate_many(
        self, x0: np.ndarray, u: np.ndarray, copies: np.ndarray, acting: Active
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Return the same for several copies of the stretches at once, each with initial states and parameters."""
        key = hash((x0.tobytes(), u.tobytes(), named(acting, copies), self.lines, self.substeps))
        return self._kept_states.get(key, lambda: self._simulated(x0, u, copies, acting))

    def _simulated(
        self, x0: np.ndarray, u: np.ndarray, copies: np.ndarray, acting: Active
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        simulator, log, given, many = self.simulator, self.log, u, len(copies)
        u = drawn(u, log.starts) if self.lines else u
        rows = side_by_side(self.stretches, max(s.stop - s.first for s in self.stretches))
        t, drive = np.tile(log.t[rows], many), np.tile(np.moveaxis(u[:, rows], 0, 1), many)
        numbers = np.concatenate([np.moveaxis(c[:, rows], 0, 1) for c in copies], axis=2)
        runner = Runner(simulator, log.dt, self.joints, self.substeps, self.lines)
        kind = tuple(place.key for place, _ in acting)
        known = self._along.get(kind, self._along.get(()))
        near = None if known is None else np.tile(np.moveaxis(known[:, rows], 0, 1), many)
        x = runner.states(t, x0, drive, numbers, acting, near=near)[:, : len(simulator.states)]
        self._failed = runner.failed
        self.simulated += many
        of = self._of
        step = np.arange(log.n) - self._firsts[of]
        states = x.reshape(*x.shape[:2], many, len(self.stretches))[step, :, :, of].transpose(2, 1, 0)
        if many == 1 and np.abs(x).max(initial=0.0) < MOST:
            self._along[kind] = states[0]
        outputs = [self._outputs_along(own, given, p, acting) for own, p in zip(states, copies, strict=True)]
        return states, np.stack(outputs)

    def _outputs_along(self, states: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Active) -> np.ndarray:
        """Return the outputs along states."""
        simulator, log = self.simulator, self.log
        if not simulator.outputs:
            return self._none
        with np.errstate(all="ignore"):
            plain = np.asarray(simulator.output(log.t, states, u, p))
            if not acting or not np.any(self._felt):
                return plain
            at = log.dt, self._firsts, log.t, states, u, p
            return plain + self._felt @ added_to_rates(simulator, acting, self.joints, *at)

    def _near(self, x0: np.ndarray, base: Drive, drive: Drive) -> tuple[np.ndarray, np.ndarray]:
        """Return the channels under a drive, or to first order under one near it."""
        if self.simulator.form == "run":
            known, straight = self._ran(x0, base.u, base.p), drive.lines and not base.lines
            near = self._ran(x0, drive.u, drive.p, True) if straight else self._combined(x0, base, drive)
            return self._shown(self._none, known, self.shown), self._shown(self._none, near, self.shown)
        if drive.alike(base):  # nothing responds to what changes readings alone
            states, outputs = self._simulate(x0, base.u, base.p, base.acting)
            return self._shown(states, outputs, self.shown), self._shown(states, outputs, self.shown)
        return self._responded(x0, base, drive, lambda response: response.to(drive))

    def _held_and_in_lines(self, x0: np.ndarray, base: Drive) -> tuple[np.ndarray, np.ndarray]:
        """Return the channels under held inputs, and under the same in lines: a run each, since they drift apart."""
        if self.simulator.form != "ode":
            return self._near(x0, base, Drive(base.u, base.p, base.acting, True))
        held, lines, along = self._simulate(x0, base.u, base.p, base.acting), self.lines, dict(self._along)
        self.lines = True
        try:
            straight = self._simulate(x0, base.u, base.p, base.acting)
        finally:
            self.lines = lines
            self._along.clear()
            self._along.update(along)
        return self._shown(*held, self.shown), self._shown(*straight, self.shown)

    def _responded(
        self, x0: np.ndarray, base: Drive, drive: Drive, change_of: Callable[[Response], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        states, outputs = self._simulate(x0, base.u, base.p, base.acting)
        response = self._response(x0, base, states)
        before = response.evaluations
        change = change_of(response)
        self.simulated += (response.evaluations - before) / (4.0 * self.substeps)
        return self._shown(states, outputs, self.shown), self._shown_near(states + change, drive)

    def _shown_near(self, states: np.ndarray, drive: Drive) -> np.ndarray:
        """Return the channels along changed states."""
        return self._shown(states, self._outputs_along(states, drive.u, drive.p, drive.acting), self.shown)

    def _combined(self, x0: np.ndarray, base: Drive, drive: Drive) -> np.ndarray:
        """Return the outputs under a drive near another: known responses superposed, only new ones simulated."""
        known = self._ran(x0, base.u, base.p)
        # Where tolerances are wide or numbers far off, responses at other values do not hold at these.
        elsewhere = self.curved or _far(base.p[:, 0], self.simulator.numbers)
        there = base.p[:, 0].tobytes() if elsewhere else b""
        done, responses = self._done.setdefault(there, ([Superposed() for _ in self.stretches], []))
        spread = np.array([np.ptp(u) or 1.0 for u in self._u])[:, None]
        size = np.array([abs(v) or 1.0 for v in self.simulator.numbers])
        changes = []
        for s in self.stretches:
            at = slice(s.first, s.stop)
            numbers = np.mean((drive.p - base.p)[:, at], axis=1) / size * np.sqrt(s.stop - s.first)
            changes.append(np.concatenate([((drive.u - base.u)[:, at] / spread).ravel(), numbers]))
        most = max(float(np.linalg.norm(c)) for c in changes)
        if not most > 0.0:
            return known
        if _far(drive.p[:, 0], base.p[:, 0]):
            return self._ran(x0, drive.u, drive.p)
        found = known.copy()
        for k, (s, change) in enumerate(zip(self.stretches, changes, strict=True)):
            if not np.any(change):
                continue
            known_as = done[k].shares(change, max(float(np.linalg.norm(change)), 0.1 * most))
            if known_as is None:
                break
            for share, number in zip(*known_as, strict=True):
                found[:, s.first : s.stop] += share * responses[number][:, s.first : s.stop]
        else:
            return found
        rows = self._ran(x0, drive.u, drive.p)
        response = (rows - known) / most
        if np.all(np.isfinite(response)):  # no other can be superposed of one that failed
            for own, change in zip(done, changes, strict=True):
                own.add(change / most, len(responses))
            responses.append(response)
        return rows

    def _slopes(self, x0: np.ndarray, numbers: np.ndarray | None = None, active: Active | None = None) -> np.ndarray:
        """Return the sensitivities of predictions to initial states, in noise, shape (n_states, n_shown, n)."""
        if self.simulator.form != "ode" or not len(x0):
            return super()._slopes(x0, numbers)
        base = self._drive(active or [], self.simulator.numbers if numbers is None else numbers)
        states, outputs = self._simulate(x0, base.u, base.p, base.acting)
        response = self._response(x0, base, states)

        def read(rows: np.ndarray) -> np.ndarray:
            return self._fold(self._read(active or [], rows, self.shown))

        before, found = read(self._shown(states, outputs, self.shown)), []
        for k, row in enumerate(x0):
            h = 1e-4 * (float(np.max(np.abs(row))) or 1.0)
            found.append((read(self._shown_near(states + h * response.of_start(k), base)) - before) / h)
        return np.stack(found) / self._scale

    def _as_read(self, x0: np.ndarray, active: Active, numbers: np.ndarray) -> np.ndarray | None:
        """Return the sensitivities to initial states as sensors with memory read them; None without such sensors."""
        if self.simulator.form != "ode" or not len(x0) or not self._late(active):
            return None
        rows, found = self._unread(x0, active, numbers), []
        before = self._read(active, rows.copy(), self.shown)
        for row, slope in zip(x0, self._begins, strict=True):
            h = 1e-4 * (float(np.max(np.abs(row))) or 1.0)
            found.append((self._read(active, rows + h * slope * self._scale, self.shown) - before) / h)
        return np.stack(found) / self._scale

    def _late(self, active: Active) -> Active:
        """Return the sensors with memory that change what is shown."""
        return [(place, made) for place, made in active if made.n_states and set(place.readings) & set(self.shown)]

    def _slopes_of_numbers(self, x0: np.ndarray, d: np.ndarray) -> np.ndarray:
        """Return the sensitivities of predictions to tolerances, in noise, shape (n_free, n_shown, n)."""
        if self.simulator.form != "ode":
            return super()._slopes_of_numbers(x0, d)
        base, found = self._drive([], self._numbers_at(d)), []
        for e in 0.01 * np.eye(len(d)):
            before, there = map(self._fold, self._near(x0, base, self._drive([], self._numbers_at(d + e))))
            found.append((there - before) / 0.01)
        return np.stack(found) / self._scale

    def _response(self, x0: np.ndarray, drive: Drive, states: np.ndarray) -> Response:
        """Return the response of runs to small changes; cached for the latest ones."""
        key = hash((x0.tobytes(), drive.u.tobytes(), named(drive.acting, drive.p), drive.lines))

        def made() -> Response:
            found = Response(self.simulator, self.log, self._firsts, states, drive, self.joints)
            self.simulated += found.evaluations / (4.0 * self.substeps)
            return found

        return self._responses.get(key, made)

    # --- jumps at unknown instants: a sensor with memory holds their noise for longer, and smaller -------------
    @abstractmethod
    def _compared(
        self, about: Active, active: Active, predictions: Iterable[np.ndarray], influence: Influence | None = None
    ) -> np.ndarray:
        """Return the change of the residuals from predictions to others, less what initial states explain."""

    @abstractmethod
    def _influence(self, slopes: np.ndarray) -> Influence:
        """Return how initial states act on the windows."""

    def _under_inputs(self, u: np.ndarray, active: Active | None = None) -> np.ndarray:
        """Return the change of the residuals under other inputs, to first order, as faulty sensors read it."""
        active, numbers = self._own if active is None else active, self.simulator.numbers
        base = self._drive(self._own, numbers)

        def made() -> tuple[np.ndarray, np.ndarray]:
            return self._near(self._x0, base, Drive(base.u + u - self._u, base.p, self._own, self.lines))

        near = [self._fold(rows).copy() for rows in self._jumped.get(hash(u.tobytes()), made)]
        slopes = self._as_read(self._x0, active, numbers)
        return self._compared(active, active, near, None if slopes is None else self._influence(slopes))

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return the growth of each window's noise where sensors read late what jumps; None without such sensors."""
        late = self._late(self.active(spec))
        if not late or not self._opened:
            return None

        def made() -> np.ndarray:
            more = [
                unknown_instants(jump, off, lambda change: self._under_inputs(self._u + change, late), REPLICATES)
                for jump, off, _ in self._opened
            ]
            shares = [(np.square(m) - np.square(known)) / np.square(self.noise)
                      for m, (*_, known) in zip(more, self._opened, strict=True)]  # fmt: skip
            return np.sqrt(np.maximum(1.0 + np.sum(shares, axis=0), np.finfo(float).eps))

        return self._growths.get(repr([(place.key, made.values) for place, made in late]), made)

    def _lay_again(self) -> None:
        self._growths.clear()
        super()._lay_again()


def _far(p: np.ndarray, q: np.ndarray) -> bool:
    """Return whether a number differs by more than a factor of e, or in sign: nothing is straight on the way."""
    ratio = np.divide(p, q, out=np.ones_like(p), where=q != 0.0)
    return not np.all((ratio * math.e >= 1.0) & (ratio <= math.e))


def named(active: Active, numbers: np.ndarray) -> int:
    """Return the cache key of effects and numbers."""
    return hash((*((place.key, *made.values.items()) for place, made in active), numbers.tobytes()))


def _in_parts(times: np.ndarray, drive: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times and inputs in parts of each step, in whose middles the inputs are those of lines."""
    within = np.arange(1 + parts * (len(times) - 1)) / parts
    row = np.minimum(within.astype(int), len(times) - 2)
    part = np.minimum(within - row + 0.5 / parts, 1.0)
    return np.interp(within, np.arange(len(times)), times), drive[:, :, row] + part * np.diff(drive, axis=2)[:, :, row]

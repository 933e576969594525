"""Predictions of a simulator over stretches of a log, and their sensitivities; runs are cached."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...effects import Effect
from ...errors import SimulatorRunError
from ...remembered import Remembered
from ...signals.paths import steady_path
from ...simulators.base import Simulator
from ...simulators.integrate import MOST, Runner, side_by_side
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog
from .between_rows import drawn, passed_on, read_between
from .protocol import Active
from .response import Drive, Response
from .states import integral
from .stretches import FOLLOWS, StretchEvidence

_PARTS = 10  # of a step, where a run goes with inputs in lines: the fastest states miss a twentieth of a step
MOST_RUNS = 200
"""Runs that are kept for the case that they are asked for again."""
ALREADY = 0.03
"""Share of a change of inputs or parameters that may be new for its response to follow from those that are known."""
MOST_RESPONSES = 6
"""The same of what runs respond to small changes."""
MOST_STATES = 12
"""The same of simulators of states, whose runs are larger: enough for readings that faults of sensors change."""


class PredictedEvidence(StretchEvidence):
    """Predictions over stretches, simulated where needed, else to first order about simulated ones."""

    overlap = 1

    def __init__(
        self, log: PortLog, simulator: Simulator, whole: bool = False, refit: bool = False, lines: bool = False,
        longest: int = 0, like: StretchEvidence | None = None,
    ) -> None:  # fmt: skip
        super().__init__(log, simulator, whole, refit, lines, longest, like)
        self._u = log.inputs(simulator)
        self.n = self.substeps = 1
        self._has_run = False
        self._failed: tuple[int, list[str], int] | None = None
        self.simulated = 0.0
        self._kept_runs: dict[int, list[np.ndarray]] = {}
        self._straight: list[np.ndarray] = []
        self._kept_states: Remembered[tuple[list[np.ndarray], list[np.ndarray]]] = Remembered(MOST_STATES)
        self._responses: Remembered[Response] = Remembered(MOST_RESPONSES)
        self._along: dict[tuple[str, ...], np.ndarray] = {}
        """The latest states along the log, by the kind of change."""
        self._begins: list[np.ndarray] = []
        """Sensitivities of predictions to the initial states of each stretch."""
        self._done: dict[bytes, list[tuple[list[np.ndarray], list[np.ndarray]]]] = {}

    def _asks_anew(self, deviations: Mapping[str, float]) -> dict[str, float]:
        """Return all deviations: initial states are fitted to each again."""
        return dict(deviations)

    def _predict(
        self, x0: np.ndarray, active: Active, numbers: np.ndarray, shown: Sequence[str] | None = None
    ) -> list[np.ndarray]:
        """Return the predicted channels, shape (n_shown, length) per stretch."""
        shown = self.shown if shown is None else shown
        return self._read(active, self._unread(x0, active, numbers, shown), shown)

    def _unread(
        self, x0: np.ndarray, active: Active, numbers: np.ndarray, shown: Sequence[str] | None = None
    ) -> list[np.ndarray]:
        """Return the same without the faults of sensors."""
        shown, drive = self.shown if shown is None else shown, self._drive(active, numbers)
        if self.simulator.form == "run":
            outputs = self._ran(x0, drive.u, drive.p)
            states = [np.zeros((0, s.stop - s.first)) for s in self.stretches]
        else:
            states, outputs = self._simulate(x0, drive.u, drive.p, drive.acting)
        return self._shown(states, outputs, shown)

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

    def _read(self, active: Active, rows: list[np.ndarray], shown: Sequence[str]) -> list[np.ndarray]:
        """Return channels as faulty sensors read them, in place."""
        ends = np.cumsum([one.shape[1] for one in rows])
        starts = np.concatenate([[0], ends[:-1]])
        for place, made in active:
            for k in [k for k, name in enumerate(shown) if name in place.readings]:
                read = read_between(place, made, np.concatenate([one[k] for one in rows]), self.log.dt, starts)
                for one, found in zip(rows, np.split(read, ends[:-1]), strict=True):
                    one[k] = found
        return rows

    def _predict_many(self, starts: Sequence[np.ndarray], numbers: Sequence[np.ndarray]) -> list[list[np.ndarray]]:
        """Return the predicted channels for several initial states and numbers, (n_shown, length) per stretch."""
        if self.simulator.form != "ode":
            return [self._predict(x, [], p) for x, p in zip(starts, numbers, strict=True)]
        many = len(starts)
        wide = [np.repeat(p[:, None], self.log.n, axis=1) for p in numbers]
        states, outputs = self._simulate(np.hstack(starts), self._u, np.stack(wide), [], many)
        rows = self._shown(states, outputs, self.shown)
        return [rows[k * len(self.stretches) : (k + 1) * len(self.stretches)] for k in range(many)]

    def _shown(self, states: list[np.ndarray], outputs: list[np.ndarray], shown: Sequence[str]) -> list[np.ndarray]:
        """Return the requested channels of a simulation."""
        names, found = (*self.simulator.outputs, *self.simulator.states), []
        for x, y in zip(states, outputs, strict=True):
            signals = dict(zip(names, (*y, *x), strict=False))
            found.append(np.stack([np.asarray(signals[n], dtype=float) for n in shown]))
        return found

    def _force(self, place: Placement, made: Effect) -> np.ndarray:
        """Return what an effect adds to an input along the log."""
        log, found = self.log, dict(self.log.channels)
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

    def _ran(self, x0: np.ndarray, u: np.ndarray, p: np.ndarray, lines: bool | None = None) -> list[np.ndarray]:
        """Return the outputs of the simulator over each stretch; earlier runs are cached.

        What inputs in lines change is that of the first such runs, whatever an effect adds: a run of many parts of each
        step takes as many times longer.
        """
        key = hash((x0.tobytes(), u.tobytes(), p.tobytes()))
        if key not in self._kept_runs:
            if len(self._kept_runs) >= MOST_RUNS:
                self._kept_runs.clear()
            self._kept_runs[key] = self._run_stretches(x0, u, p, 1)
        found = self._kept_runs[key]
        if not (self.lines if lines is None else lines):
            return found
        if [d.shape[1] for d in self._straight] != [y.shape[1] for y in found]:
            parts = self._run_stretches(x0, u, p, _PARTS)
            self._straight = [y - held for y, held in zip(parts, found, strict=True)]
        return [y + d for y, d in zip(found, self._straight, strict=True)]

    def _run_stretches(self, x0: np.ndarray, u: np.ndarray, p: np.ndarray, parts: int) -> list[np.ndarray]:
        """Return the outputs over each stretch, inputs held over each of as many parts of a step."""
        t = self.log.t
        lengths = np.array([s.stop - s.first for s in self.stretches])
        found: dict[int, np.ndarray] = {}
        for length in np.unique(lengths):  # runs of one length are simulated together
            mine = np.flatnonzero(lengths == length)
            spans = [slice(self.stretches[k].first, self.stretches[k].stop) for k in mine]
            drive, numbers = np.stack([u[:, a] for a in spans]), np.stack([np.mean(p[:, a], axis=1) for a in spans])
            starts = x0.T[mine] if len(x0) else np.zeros((len(mine), 0))
            times = t[spans[0]] - t[spans[0]][0]
            times, drive = _in_parts(times, drive, parts) if parts > 1 else (times, drive)
            ran = self._asked_for(times, drive, numbers, starts)
            found |= {int(k): y[:, ::parts] for k, y in zip(mine, ran, strict=True)}
        self.simulated += parts * float(np.sum(lengths)) / self.log.n
        return [found[k] for k in range(len(lengths))]

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
            if max(float(np.max(np.abs(x))) for x in states) >= MOST:
                self._simulated(x0, self._u, p, [], 1)  # one that is kept does not say where it failed
                if self._failed is not None:
                    row, failed, k = self._failed
                    self._refuse_run(", ".join(failed), "not finite", k, row + 1)
            for k, rows in enumerate(outputs):
                if len(bad := np.argwhere(~np.isfinite(rows))):
                    output, at = bad[0]
                    self._refuse_run(simulator.outputs[output], f"{rows[output, at]:g}", k, int(at))

    def _refuse_run(self, what: str, value: str, stretch: int, row: int) -> None:
        first = self.stretches[stretch].first
        run = self.log.names[self.log.run[first]]
        raise SimulatorRunError(
            f"The simulator's prediction of {what} is {value} after {row * self.log.dt:.6g} s from "
            f"{self.log.t[first]:.6g} s of '{run}'.",
            "finite rates and outputs wherever the simulator goes",
            "Correct the simulator, or its parameters and inputs.",
        )

    def _simulate(
        self, x0: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Active, many: int = 1
    ) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return states and outputs of each stretch; of several copies at once, each with parameters of its own."""
        key = hash((x0.tobytes(), u.tobytes(), named(acting, p), self.lines, self.substeps))
        return self._kept_states.get(key, lambda: self._simulated(x0, u, p, acting, many))

    def _simulated(
        self, x0: np.ndarray, u: np.ndarray, p: np.ndarray, acting: Active, many: int
    ) -> tuple[list[np.ndarray], list[np.ndarray]]:
        simulator, log, given = self.simulator, self.log, u
        u = drawn(u, log.starts, self.substeps) if self.lines else u
        length = max(s.stop - s.first for s in self.stretches)
        rows = side_by_side(self.stretches, length)
        copies = [p] if p.ndim == 2 else list(p)
        t, drive = np.tile(log.t[rows], many), np.tile(np.moveaxis(u[:, rows], 0, 1), many)
        numbers = np.concatenate([np.moveaxis(c[:, rows], 0, 1) for c in copies], axis=2)
        runner = Runner(simulator, log.dt, self.joints, self.substeps, self.lines)
        kind = tuple(place.key for place, _ in acting)
        known = self._along.get(kind, self._along.get(()))
        near = None if known is None else np.tile(np.moveaxis(known[:, rows], 0, 1), many)
        x = runner.states(t, x0, drive, numbers, acting, near=near)[:, : len(simulator.states)]
        self._failed = runner.failed
        self.simulated += many
        stretches = self.stretches * many
        states = [x[: s.stop - s.first, :, k].T for k, s in enumerate(stretches)]
        if many == 1 and np.abs(x).max(initial=0.0) < MOST:
            along = self._along[kind] = np.zeros((len(simulator.states), log.n))
            for stretch, own in zip(stretches, states, strict=True):
                along[:, stretch.first : stretch.stop] = own
        return states, self._outputs_along(states, given, copies)

    def _outputs_along(self, states: list[np.ndarray], u: np.ndarray, copies: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return the outputs along the states of each stretch, for each of several sets of parameters in turn."""
        if not self.simulator.outputs:
            return [np.zeros((0, x.shape[1])) for x in states]
        found = []
        for k, x in enumerate(states):
            copy, place = divmod(k, len(self.stretches))
            at = slice(self.stretches[place].first, self.stretches[place].stop)
            with np.errstate(all="ignore"):
                found.append(self.simulator.output(self.log.t[at], x, u[:, at], copies[copy][:, at]))
        return found

    def _near(self, x0: np.ndarray, base: Drive, drive: Drive) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the channels under a drive, or to first order under one near it."""
        if self.simulator.form == "run":
            known, straight = self._ran(x0, base.u, base.p), drive.lines and not base.lines
            near = self._ran(x0, drive.u, drive.p, True) if straight else self._combined(x0, base, drive)
            none = [np.zeros((0, s.stop - s.first)) for s in self.stretches]
            return self._shown(none, known, self.shown), self._shown(none, near, self.shown)
        if drive.alike(base):  # nothing responds to what changes readings alone
            states, outputs = self._simulate(x0, base.u, base.p, base.acting)
            return self._shown(states, outputs, self.shown), self._shown(states, outputs, self.shown)
        return self._responded(x0, base, drive, lambda response: response.to(drive))

    def _held_and_in_lines(self, x0: np.ndarray, base: Drive) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the channels under held inputs, and under the same in lines: a run each, since they may be far apart.

        Over a run a simulator that integrates its inputs adds up the difference.
        """
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

    def _stepped(self, x0: np.ndarray, base: Drive) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the channels under a drive, exactly and with steps of Euler's method."""
        return self._responded(x0, base, base, lambda response: response.of_steps())

    def _responded(
        self, x0: np.ndarray, base: Drive, drive: Drive, change_of: Callable[[Response], np.ndarray]
    ) -> tuple[list[np.ndarray], list[np.ndarray]]:
        states, outputs = self._simulate(x0, base.u, base.p, base.acting)
        response = self._response(x0, base, states)
        before = response.evaluations
        change = change_of(response)
        self.simulated += (response.evaluations - before) / (4.0 * self.substeps)
        return self._shown(states, outputs, self.shown), self._shown(
            *self._moved_states(states, change, drive), self.shown
        )

    def _moved_states(
        self, states: list[np.ndarray], change: np.ndarray, drive: Drive
    ) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the states of each stretch with a change, and the outputs that belong to them."""
        near = [x + change[:, s.first : s.stop] for x, s in zip(states, self.stretches, strict=True)]
        return near, self._outputs_along(near, drive.u, [drive.p])

    def _combined(self, x0: np.ndarray, base: Drive, drive: Drive) -> list[np.ndarray]:
        """Return the outputs under a drive near another: responses are superposed, only new ones simulated.

        Responses are linear to first order, so that a change that is a sum of others, such as a lag between two whose
        responses are known, needs no run.
        """
        known = self._ran(x0, base.u, base.p)
        # Where tolerances are wide or numbers far off, responses at other values do not hold at these.
        elsewhere = self.curved or _far(base.p[:, 0], self.simulator.numbers)
        done = self._done.setdefault(base.p[:, 0].tobytes() if elsewhere else b"", [])
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
        found: list[np.ndarray] = []
        for k, change in enumerate(changes):
            if not (done and np.any(change)):
                found.append(known[k])
                if np.any(change):
                    break
                continue
            columns = np.stack([w[k] for w, _ in done], axis=1)
            share = np.linalg.lstsq(columns, change, rcond=1e-6)[0]
            wanted = max(float(np.linalg.norm(change)), 0.1 * most)
            # Known responses that nearly cancel would leave more of their errors than there is to know.
            cancelled = ALREADY * float(np.abs(share) @ np.linalg.norm(columns, axis=0)) > wanted
            if cancelled or np.linalg.norm(change - columns @ share) > ALREADY * wanted:
                break
            found.append(known[k] + np.tensordot(share, np.stack([y[k] for _, y in done]), axes=1))
        else:
            return found
        rows = self._ran(x0, drive.u, drive.p)
        responses = [(a - b) / most for a, b in zip(rows, known, strict=True)]
        if all(np.all(np.isfinite(one)) for one in responses):  # no other can be superposed of one that failed
            done.append(([c / most for c in changes], responses))
        return rows

    def _slopes(
        self, x0: np.ndarray, numbers: np.ndarray | None = None, active: Active | None = None
    ) -> list[np.ndarray]:
        """Return the sensitivities of predictions to initial states, in noise, shape (n_states, n_shown, length)."""
        if self.simulator.form != "ode" or not len(x0):
            return super()._slopes(x0, numbers)
        base = self._drive(active or [], self.simulator.numbers if numbers is None else numbers)
        states, outputs = self._simulate(x0, base.u, base.p, base.acting)
        response = self._response(x0, base, states)

        def read(states: list[np.ndarray], outputs: list[np.ndarray]) -> list[np.ndarray]:
            return self._fold(self._read(active or [], self._shown(states, outputs, self.shown), self.shown))

        before, found = read(states, outputs), []
        for k, row in enumerate(x0):
            h = 1e-4 * (float(np.max(np.abs(row))) or 1.0)
            there = read(*self._moved_states(states, h * response.of_start(k), base))
            found.append([(a - b) / h for a, b in zip(there, before, strict=True)])
        return self._in_noise(found)

    def _as_read(self, x0: np.ndarray, active: Active, numbers: np.ndarray) -> list[np.ndarray] | None:
        """Return the sensitivities to initial states as sensors with memory read them; None without such sensors.

        A lag holds what an initial state does for longer than the motion.
        """
        if self.simulator.form != "ode" or not len(x0) or not self._late(active):
            return None
        rows, found = self._unread(x0, active, numbers), []
        sigma = np.array([self.sigma[n] for n in self.shown])[:, None]
        before = self._read(active, [one.copy() for one in rows], self.shown)
        for k, row in enumerate(x0):
            h = 1e-4 * (float(np.max(np.abs(row))) or 1.0)
            moved = [one + h * slope[k] * sigma for one, slope in zip(rows, self._begins, strict=True)]
            there = self._read(active, moved, self.shown)
            found.append([(a - b) / h for a, b in zip(there, before, strict=True)])
        return self._in_noise(found)

    def _late(self, active: Active) -> Active:
        """Return the sensors with memory that change what is shown."""
        return [(place, made) for place, made in active if made.n_states and set(place.readings) & set(self.shown)]

    def _slopes_of_numbers(self, x0: np.ndarray, d: np.ndarray) -> list[np.ndarray]:
        """Return the sensitivities of predictions to tolerances, in noise, shape (n_free, n_shown, length)."""
        if self.simulator.form != "ode":
            return super()._slopes_of_numbers(x0, d)
        base, found = self._drive([], self._numbers_at(d)), []
        for e in 0.01 * np.eye(len(d)):
            before, there = map(self._fold, self._near(x0, base, self._drive([], self._numbers_at(d + e))))
            found.append([(a - b) / 0.01 for a, b in zip(there, before, strict=True)])
        return self._in_noise(found)

    def _in_noise(self, found: list[list[np.ndarray]]) -> list[np.ndarray]:
        """Return changes of the channels of every stretch, concatenated, in units of the noise."""
        sigma = np.array([self.sigma[n] for n in self.shown])[:, None]
        return [np.stack([f[j] for f in found]) / sigma for j in range(len(self.stretches))]

    def _response(self, x0: np.ndarray, drive: Drive, states: list[np.ndarray]) -> Response:
        """Return the response of runs to small changes; cached for the latest ones."""
        key = hash((x0.tobytes(), drive.u.tobytes(), named(drive.acting, drive.p), drive.lines))

        def made() -> Response:
            firsts = np.array([s.first for s in self.stretches])
            found = Response(self.simulator, self.log, firsts, np.concatenate(states, axis=1), drive, self.joints)
            self.simulated += found.evaluations / (4.0 * self.substeps)
            return found

        return self._responses.get(key, made)


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

r"""Residuals of a simulator's own equations, where the log holds its states: nothing is simulated.

The rates of the states are tested in the weak form, as the bench's equations are (`pamid.equations.windows`):

.. math:: r_w = \int B_{m+1}^{(w)}\,\big(c^{(m)} - f(x, u, p)\big)\,\mathrm{d}t

with the m-th derivative of the channel c moved onto the test function: m = 1 where a state is logged, m = 2 where only
the position is whose velocity it is, and m = 0 for an output. Chaotic and unstable systems do not diverge, and an
effect that acts on a joint adds to one equation.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from ...equations.windows import average, span, starts
from ...remembered import Remembered
from ...signals.paths import steady_path
from ...signals.rates import differentiate, tune_cutoff
from ...signals.resting import at_rest
from ...simulators.accelerations import rates_read
from ...simulators.base import Simulator
from ...simulators.integrate import STEPS
from ...simulators.links import Link
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog
from ...simulators.structure import (
    JointPort,
    fed_by,
    joints_of,
    pushes_of,
    rate_unit,
)
from ..settings import OF_ITS_OWN
from .along import changed, wide
from .balance import Balance
from .bends import carried, matters, simpson, steps_of
from .between_rows import after, before, needed, passed_on, timings
from .derived import speed_slopes, typical_slopes
from .kinematic import ACCURACY, as_read, bent, both_measured, nuisances
from .kinks import at_unknown_instants, root_mean_square
from .motion_rates import MotionRates
from .port_signals import PortWindows
from .protocol import Active
from .states import integral, pairs_of, resting_joints
from .steps import earlier, within_steps
from .tolerances import rms
from .turned import Turned, turned
from .turning import force_at_both_ends
from .window_length import Rate, no_windows, samples


class DirectEvidence(MotionRates):
    """Residuals of the equations of a simulator whose states the log holds."""

    how = "of the simulator's own equations in the weak form, since the log contains their states"

    def __init__(
        self, log: PortLog, simulator: Simulator, derived: Mapping[str, str], refit: bool = False, lines: bool = False,
        n: int = 0,
    ) -> None:  # fmt: skip
        super().__init__(log, simulator, refit, lines)
        self.derived, self.n = dict(derived), n
        self.pairs = pairs_of(simulator, log) if simulator.form == "ode" else {}
        if simulator.form == "algebraic":
            self.how = "of the simulator's outputs at the logged inputs"
        elif derived:
            self.how = f"{self.how}, or positions that show them"
        self._tuning: dict[str, float] = {}
        self._straight: dict[tuple[int, float], bool] = {}
        # Of two sets of parameters, and what inputs do there; what states do at one.
        self._asked: Remembered[np.ndarray] = Remembered(2 * (1 + len(simulator.inputs)) + len(simulator.states))
        self._table: dict[str, np.ndarray] = {}
        self._spreads, self._moved = Remembered[Any](16), Remembered[Any](8)
        self._jumps: dict[str, np.ndarray] = {}
        self._tables: list[dict[str, np.ndarray]] = []
        self._x, self._base_rates = np.zeros((0, log.n)), np.zeros((0, 2 * log.n))
        self._bend = np.zeros((len(simulator.states), 2 * log.n))
        self._curve = np.zeros((len(simulator.states), log.n))
        self._exact = STEPS
        self._step: float | None = None
        """Step by which the simulator is run over each sample; None where lines between its ends are enough."""
        self._through = np.eye(len(simulator.states))
        self._felt = np.zeros((len(simulator.outputs), len(simulator.states)))
        self._fast, self._u = False, log.inputs(simulator)
        self._x, self._table = self._motion(log.channels)
        if simulator.form == "ode":
            at = self._some()
            self.pushes = pushes_of(simulator, *at, self._steps)
            found = joints_of(simulator, self.pairs, self.pushes)  # of a speed alone the integral is the path
            self.joints: list[JointPort] = [j if j.position in log.channels else j._replace(position="") for j in found]
            self.feeds = fed_by(simulator, *at)
            self._felt = rates_read(simulator, {j.velocity for j in self.joints}, *at)
            self._rounding = speed_slopes(simulator, derived, *at)
            self._base_rates = self._rates(self._x, self._u, self._ends(self._u), simulator.numbers)
            self._bend = self._bent(self._base_rates, self._ends(self._u))
        else:
            self.pushes, self.joints = {}, []
        self.balances = self._balances()
        self._turned: Turned | None = None
        self._lay_windows()
        self._run_within_steps()
        self._turned = self._turn()
        if self._turned is not None and self._turned.forces:
            units = {j.name: j.unit for j in self.joints}
            self.windows = [w._replace(unit=units.get(w.equation, w.unit)) for w in self.windows]
        self._skew()
        self._settle()

    def _again(self) -> None:
        """Clear caches of the simulator with other parameters."""
        self._asked.clear()
        if self.simulator.form == "ode":
            self._base_rates = self._rates(self._x, self._u, self._ends(self._u), self.simulator.numbers)
            self._bend = self._bent(self._base_rates, self._ends(self._u))
            self.pushes = pushes_of(self.simulator, *self._some(), self._steps)

    @property
    def modelled(self) -> np.ndarray:
        """Modelled rates at both ends of each step, inputs held, shape (n_states, 2 n_rows)."""
        return self._rates(self._x, self._u, self._u, self.simulator.numbers) if self.lines else self._base_rates

    # --- the equations --------------------------------------------------------------------------------------
    def _balances(self) -> list[Balance]:
        simulator, log = self.simulator, self.log
        names = {j.velocity: j.name for j in self.joints}
        positions = {v: p for p, v in self.pairs.items()}
        found = []
        for row, state in enumerate(simulator.states):
            if state in self.pairs:
                continue
            unit, name = rate_unit(simulator, state), names.get(state, state)
            if state in self.derived.values():
                found.append(Balance(name, positions[state], 2, row, unit))
            elif state in log.channels:
                found.append(Balance(name, state, 1, row, unit))
        named = {b.name for b in found}
        for position, velocity in both_measured(self.pairs, log).items():
            row, name = simulator.states.index(position), velocity if velocity not in named else position
            found.append(Balance(name, position, 1, row, rate_unit(simulator, position), velocity))
        for row, output in enumerate(simulator.outputs):
            if output in log.channels:
                found.append(Balance(output, output, 0, row, simulator.port(output).unit))
        return found

    def _lay_windows(self) -> None:
        log = self.log
        self.n = self.n or samples([self._says(b) for b in self.balances], log)
        self._first, self._moving = list[list[np.ndarray]](), list[np.ndarray]()
        self.windows, hidden = [], log.hidden(self.n)
        resting = resting_joints(log, self.joints, {b.name for b in self.balances}, self.n)
        self.notes += [at_rest(j.position, float(resting[j.name].mean())) for j in self.joints if j.name in resting]
        for b in self.balances:
            firsts, rows, centres, measured, moving = [], [], [], [], []
            for a, e in log.spans:
                first = starts(e - a - b.order, self.n, b.order + 1)
                reach = span(self.n, b.order + 1) + b.order
                kept = np.array([not hidden[a + f : a + f + reach].any() for f in first], dtype=bool)
                first = first[kept] if len(first) else first
                rest = resting.get(b.name, hidden)
                moves = np.array([not rest[a + f : a + f + reach].any() for f in first], dtype=bool)
                firsts.append(first)
                moving.append(moves)
                rows.append(a + first[moves])
                centres.append(a + first[moves] + (reach - 1) // 2)
                series = b.rate(log.channels[b.channel][a:e], log.dt)
                measured.append(average(series, self.n, b.order + 1, first[moves]))
            self._first.append(firsts)
            self._moving.append(np.concatenate(moving))
            self.windows.append(
                PortWindows(b.name, b.unit, np.concatenate(rows), np.concatenate(centres), np.concatenate(measured))
            )
        if not any(len(w.first) for w in self.windows):
            raise no_windows(log, self.n)

    def _with_lines(self) -> np.ndarray:
        """Return the change of the residuals by inputs that go straight from row to row."""
        ends = after(self._u, self.log)
        rates = self._rates(self._x, self._u, ends, self.simulator.numbers)
        change = rates + self._bent(rates, ends) - self._base_rates - self._bend
        return self._under(self._u, change) - self._under(self._u)

    def _skew(self) -> None:
        """Add nuisance parameters with tolerances.

        Clocks of positions and velocities differ by half a step, velocities curve, inputs act up to half a sample early
        or late, and a joint's drive has an offset too small to be distinguished from inexact forms of causes.
        """
        ends = np.cumsum([0, *(len(w.first) for w in self.windows)])
        driven, plain = {j.name for j in self.joints}, self._residual([], self.simulator.numbers)
        for k, b in enumerate(self.balances):
            part, found = slice(ends[k], ends[k + 1]), {}
            if b.velocity:
                within = self._accelerations()[self.simulator.states.index(b.velocity)]
                rates = nuisances(self.log.channels[b.velocity], within, self.log, self.n, self._first[k])
                found = {f"{name} of {b.velocity}": own for name, own in rates.items()}
            elif b.name in driven and np.all(np.isfinite(plain[part])):
                small = OF_ITS_OWN * float(np.sqrt(np.mean(np.square(plain[part])))) if ends[k + 1] > ends[k] else 0.0
                found = {f"offset of {b.name}": np.full(ends[k + 1] - ends[k], small)}
            for name, own in found.items():
                if np.any(own):
                    self.skews[name] = np.zeros(ends[-1])
                    self.skews[name][part] = own
        if self.simulator.form == "ode":
            self.skews |= needed(self._timed(self._own), self._u, self.simulator.inputs, self.log)
            derived, step = list(self.derived.values()), self.simulator.own_step
            for name, change in within_steps(
                self._base_rates, self._late, self._at_once, self.simulator.states, derived, self.balances, self.log,
                step, self._bend, self._implicit(step),
            ):  # fmt: skip
                column = self._under(self._u, change) - plain
                if np.any(column) and np.all(np.isfinite(column)):
                    self.skews[name] = column
        self._allow()

    def _timed(self, active: Active) -> dict[str, np.ndarray]:
        inputs, log, held = self.simulator.inputs, self.log, not self.lines
        plain = self._under(passed_on(active, self._u, inputs, log, held))
        return {name: self._under(moved) - plain for name, moved in timings(active, self._u, inputs, log, held)}

    def _accelerations(self) -> np.ndarray:
        """Return the simulator's rates at both ends of each step."""
        return self._base_rates

    def _between(self) -> np.ndarray | float:
        if self.simulator.form != "ode":
            return 0.0
        change = at_unknown_instants(self._curve, self._accelerations(), self.simulator.states, self.pairs, self.log)
        plain = self._under(self._u)
        return root_mean_square(change, lambda some: self._under(self._u, some) - plain)

    def _late(self, late: np.ndarray) -> np.ndarray:
        """Return the rates of the states as they were some samples earlier.

        Readings of what happens within a step have noise that scales the residual's: the model tells it, unless its
        steps count beside causes without which it is far off.
        """
        if self.simulator.own_step > 0.0:
            x = earlier(self._x, late, self.log)
        else:
            x = self._x - late[:, None] * self.log.dt * self._base_rates[:, : self.log.n]
        return self._rates(x, self._u, self._ends(self._u), self.simulator.numbers)

    def _at_once(self, new_speed: bool) -> np.ndarray:
        """Return the rates that a step of a whole sample takes; derived speeds are those before it, or in it."""
        at, p = self._x.copy(), wide(self.simulator.numbers, self.log.n)
        aside = np.zeros((len(at), 1))
        for position, velocity in self.derived.items():
            row, q = self.simulator.states.index(velocity), self.log.channels[position][None]
            at[row] = (after(q, self.log) - before(q, self.log)) / (2.0 * self.log.dt)
            aside[row] = (-0.5 if new_speed else 0.5) * self.log.dt
        rates = self.simulator.rate(self.log.t, at, self._u, p)
        for _ in range(2):  # exact to second order of the step
            rates = self.simulator.rate(self.log.t, at + aside * rates, self._u, p)
        return rates

    def _implicit(self, step: float) -> np.ndarray:
        """Return what a model's own steps change in accelerations, for steps of a sample."""
        simulator, out, step = self.simulator, np.zeros_like(self._base_rates), min(step, self.log.dt)
        if step > 0.0 and self._step is None:  # else it is run over whole samples
            _, x, u, p = self._both(self._x, self._u, self._ends(self._u), simulator.numbers)
            later = simulator.own_steps(x, u, u, p, step, step)
            rows = [simulator.states.index(j.velocity) for j in self.joints]
            change = 0.0 if later is None else ((later - x) / step - self._base_rates)[rows]
            out[rows] = change * (self.log.dt / step)
        return out

    def _under(self, u: np.ndarray, change: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the residuals under other inputs, or with rates that differ."""
        known, readings = self.simulator.numbers, self.log.channels
        rates = self._total_rates(self._x, u, np.hstack([u, self._ends(u)]), known, False)
        rates = rates + as_read(self.derived, readings, self.simulator.states, self._x, self.log)
        return self._windowed([], readings, rates + change, self._outputs(self._x, u, known))

    def _outputs(self, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        log, simulator = self.log, self.simulator
        return simulator.output(log.t, x, u, wide(p, log.n)) if simulator.outputs else np.zeros((0, log.n))

    def _says(self, b: Balance) -> Rate:
        modelled = self._base_rates[b.row, : self.log.n] if b.order else self.log.channels[b.channel]
        return Rate(modelled, b.order, self.channel_noise(b.channel))

    def _accuracy(self, equation: int) -> float:
        return ACCURACY if self.balances[equation].velocity else 0.0

    # --- motion ---------------------------------------------------------------------------------------------
    def _motion(self, channels: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the states at each row, and all signals by name with the paths of the joints."""
        log, table = self.log, dict(channels)
        for position, velocity in self.derived.items():
            known = channels[position] is log.channels[position] and velocity in self._table
            table[velocity] = self._table[velocity] if known else self._derivative(position, channels[position])
        x = np.stack([table.get(s, np.full(log.n, self.simulator.port(s).begins)) for s in self.simulator.states]) if (
            self.simulator.states
        ) else np.zeros((0, log.n))  # fmt: skip
        table.update(zip(self.simulator.states, x, strict=True))
        return x, table

    def _derivative(self, name: str, x: np.ndarray) -> np.ndarray:
        log, out = self.log, np.empty(self.log.n)
        if name not in self._tuning:
            pieces = [slice(a, b) for a, b in log.spans]
            self._tuning[name] = tune_cutoff([x[s] for s in pieces], [log.t[s] for s in pieces])
        for a, b in log.spans:
            out[a:b] = differentiate(x[a:b], log.t[a:b], tuning=self._tuning[name], warn=False)[1]
        return out

    def _path(self, name: str, table: dict[str, np.ndarray], link: Link | None) -> np.ndarray:
        """Return the path of a joint, or across two, without reversals by noise; for speeds alone their integral."""
        key, sources = f"{name}.steady", (name,) if link is None else link.sources[name]
        if key in table:
            return table[key]
        of = [self.speeds.get(n, n) for n in sources]
        ratios = (1.0,) if link is None else (1.0, -link.ratio)
        paths = [table[n] if n == o else integral(table[o], self.log) for n, o in zip(sources, of, strict=True)]
        path = np.sum([r * x for r, x in zip(ratios, paths, strict=True)], axis=0)
        if of == list(sources):
            noise = [r * self.channel_noise(n) for r, n in zip(ratios, of, strict=True) if n in self.log.channels]
            path = steady_path(path, self.log.starts, float(np.linalg.norm(noise)), max(self.n, 5))
        table[key] = path
        return path

    # --- residuals ------------------------------------------------------------------------------------------
    def _residual(
        self, active: Active, numbers: np.ndarray, channels: Mapping[str, np.ndarray] | None = None,
        followed: dict[str, np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        log, simulator = self.log, self.simulator
        readings = dict(channels or log.channels)
        restored = any(x is not log.channels.get(n) for n, x in readings.items() if n not in simulator.inputs)
        for place, made in active:
            for name in set(place.readings) & set(readings) & set(simulator.states):
                readings[name], restored = place.truth(made, readings[name], log.dt, log.starts), True
        x, table = self._motion(readings) if restored else (self._x, self._table)
        u = np.stack([readings.get(n, self._u[k]) for k, n in enumerate(simulator.inputs)]) if len(self._u) else self._u
        p: np.ndarray = numbers
        for place, made in active:
            if place.enters == "parameter":
                p = changed(p, place, made, simulator, log)
        u = passed_on(active, u, simulator.inputs, log, not self.lines)
        shown, pushed = u.copy(), np.hstack([u, self._ends(u)])
        added, felt = np.zeros((len(x), 2 * log.n)), np.zeros_like(x)
        for place, made in active:
            if place.acts:
                rows, both = self._force(place, made, followed or table)
                place.push(made, both, simulator, self._both(x, u, self._ends(u), p), pushed, added)
                if simulator.outputs:
                    place.push(made, rows, simulator, (log.t, x, u, wide(p, log.n)), shown, felt)
        if simulator.form == "algebraic":
            return self._windowed(active, readings, np.zeros((0, 0)), self._outputs(x, shown, p))
        rates = self._total_rates(x, u, pushed, p, restored) + self._through @ added
        rates = rates + as_read(self.derived, readings, simulator.states, x, log)
        return self._windowed(active, readings, rates, self._outputs(x, shown, p) + self._felt @ felt)

    def _force(self, place: Placement, made: Any, table: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the force of an effect at the rows, and at both ends of each step."""
        log, found = self.log, dict(table)
        if place.link is not None:
            found |= place.link.across(found)
        for role, name in place.follows.items():
            if role == "position" and (place.effect.path_dependent or name not in found):
                found[name] = self._path(name, table, place.link)
        return force_at_both_ends(place, made, found, self._speed_of(place), self.derived, log)

    def _speed_of(self, place: Placement) -> str:
        """Return the speed at which the path goes that an effect follows."""
        path = place.follows.get("position", "")
        if place.link is not None:
            return place.link.follows.get("velocity", "")
        return next((j.velocity for j in self.joints if path in (j.position, f"{j.name}.path")), "")

    def _bent(self, rates: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return what bends within a step adds to mean rates without it, where Simpson's rule halves the error."""
        if self._step is not None:
            self._curve = np.zeros_like(self._curve)
            return np.zeros_like(rates)
        start, end = np.hsplit(rates, 2)
        p = wide(self.simulator.numbers, self.log.n)
        bend = simpson(self.simulator, self.log, self._x, rates, 0.5 * (self._u + ends), p)
        self._curve, self._fast = bend.copy(), self._fast or (not self.derived and matters(bend, start))
        for row, change in zip(bend, end - start, strict=True):
            if not rms(row) < 0.5 * rms(change):
                row[:] = 0.0
        return np.tile(bend, 2)

    def _run_within_steps(self) -> None:
        """Run the simulator over samples in which its rates curve much, by the steps that explain most, if any do."""
        if not self._fast:
            return

        def left(step: float | None) -> float:
            self._step = step
            self._again()
            z = self._residual([], self.simulator.numbers)
            ends = np.cumsum([0, *(len(w.first) for w in self.windows)])
            found = sum((b - a) * np.log(rms(z[a:b]) + 1e-300) for a, b in pairwise(ends))
            return float(found) if np.isfinite(found) else np.inf

        best = min((None, *steps_of(self.simulator)), key=left)
        left(best)
        self.runs_within_steps = best is not None
        if best == 0.0:
            self._take_fewer_steps()
        if self.runs_within_steps:
            self._through = carried(typical_slopes(self.simulator, self.simulator.states, *self._some()), self.log.dt)
        if best and best != self.simulator.own_step:
            self.notes.append(
                f"The log looks as if the model had produced it in steps of {1e3 * best:g} ms, not of the "
                f"{1e3 * self.simulator.own_step:g} ms that it states. The fit uses these steps; they do not count as "
                "a cause."
            )

    def _windowed(
        self, active: Active, readings: Mapping[str, np.ndarray], rates: np.ndarray, outputs: np.ndarray
    ) -> np.ndarray:
        log = self.log
        modelled = {b.name: outputs[b.row] for b in self.balances if not b.order}
        for place, made in active:
            for name in set(place.readings) & set(modelled):
                modelled[name] = place.reading(made, modelled[name], log.dt, log.starts)

        def each(b: Balance, rows: slice) -> np.ndarray:
            y = b.rate(readings[b.channel][rows], log.dt)
            if not b.order:
                return y - modelled[b.name][rows]
            y = y - b.mean(rates[b.row, rows], rates[b.row, log.n :][rows])
            return y + bent(readings[b.velocity][rows]) if b.velocity and self._step is None else y

        parts = []
        for b, firsts in zip(self.balances, self._first, strict=True):
            runs = [(slice(a, e), first) for (a, e), first in zip(self.log.spans, firsts, strict=True)]
            parts.append(np.concatenate([average(each(b, rows), self.n, b.order + 1, first) for rows, first in runs]))
        return self._as_tested(parts)

    def _turn(self) -> Turned | None:
        """Return the map from residuals of rates of one order to forces, or one that decouples the joints' drives."""
        moving = [(k, b) for k, b in enumerate(self.balances) if b.order and not b.velocity]
        if not moving or len({b.order for _, b in moving}) > 1:
            return None
        order, firsts = moving[0][1].order, self._first[moving[0][0]]
        reach = span(self.n, order + 1) + order
        at = np.concatenate([a + f for (a, _), f in zip(self.log.spans, firsts, strict=True)]) + (reach - 1) // 2
        equations = [(k, b.row, b.name) for k, b in moving]
        t, x, u = self.log.t[at], self._x[:, at], self._u[:, at]
        return turned(self.simulator, equations, self.joints, t, x, u, self._steps)

"""A logged motion: its signals, and rates under other inputs, readings and numbers, by few answers of the simulator."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping

import numpy as np

from ...remembered import Remembered
from ...simulators.sizes import SignalSizes
from ...simulators.structure import some_instants, straight
from ..settings import EXCESS
from .along import wide
from .bends import fewest, means
from .between_rows import after
from .derived import rounded_off
from .states import integral, roles_of
from .tolerances import rms
from .undone import UndoneEvidence
from .window_length import window_noise

Instant = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class MotionRates(UndoneEvidence, ABC):
    """Residuals of a log that holds the motion, with the rates that the simulator has along it."""

    _table: dict[str, np.ndarray]
    pushes: dict[tuple[str, str], float]
    derived: dict[str, str]
    _asked: Remembered[np.ndarray]
    _straight: dict[tuple[int, float], bool]
    _base_rates: np.ndarray
    _bend: np.ndarray
    _rounding: np.ndarray
    _step: float | None
    _exact: int
    """Steps in which a sample is run over where it is run as good as exactly."""

    @property
    def says_forces(self) -> bool:
        """Whether residuals are converted to forces."""
        return self._turned is not None and self._turned.forces

    def _some(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return some instants with the states and inputs there."""
        some = some_instants(self.log.n)
        return self.log.t[some], self._x[:, some], self._u[:, some]

    @property
    def _steps(self) -> np.ndarray:
        """Changes of inputs that count as small."""
        return 1e-3 * np.array([np.ptp(u) or 1.0 for u in self._u])

    def _survey(self, gaps: Mapping[str, float]) -> SignalSizes:
        log, spans = self.log, {name: float(np.ptp(x)) for name, x in self._table.items()}
        for j in self.joints:
            if not j.position:
                spans[f"{j.name}.path"] = float(np.ptp(integral(self._table[j.velocity], log)))
        readings = list(dict.fromkeys(n for b in self.balances for n in (b.channel, b.velocity) if n))
        tops, lows = ({k: float(of(x)) for k, x in self._table.items()} for of in (lambda x: np.max(np.abs(x)), np.min))
        if self.says_forces:  # as the rates that they cause
            push = {j.name: abs(self.pushes.get((j.through, j.velocity), 1.0)) for j in self.joints}
            gaps = {name: gap * push.get(name, 1.0) for name, gap in gaps.items()}
        return SignalSizes(
            spans, tops, lows, gaps, readings, self.pushes, self.joints, log.usual_seconds, log.dt, self.feeds,
            again=log.again,
        )  # fmt: skip

    def signals(self) -> dict[str, np.ndarray]:
        """Return all signals at each row of the log, by name."""
        inputs = dict(zip(self.simulator.inputs, self._u, strict=True))
        return {**{k: v for k, v in self._table.items() if "." not in k}, **inputs}

    def roles(self, equation: str) -> dict[str, str]:
        """Return for an equation the signal of each name of the state, where there is one."""
        return roles_of(self.simulator, self.joints, equation)

    # --- rates -------------------------------------------------------------------------------------------------
    def _ends(self, u: np.ndarray) -> np.ndarray:
        """Return the inputs at the end of each step."""
        return after(u, self.log) if self.lines else u

    def _both(self, x: np.ndarray, u0: np.ndarray, u1: np.ndarray, p: np.ndarray) -> Instant:
        """Return times, states, inputs and parameters at both ends of each step."""
        log, each = self.log, wide(p, self.log.n)
        t = np.concatenate([log.t, log.t + log.dt])
        return t, np.hstack([x, after(x, log)]), np.hstack([u0, u1]), np.hstack([each, after(each, log)])

    def _rates(self, x: np.ndarray, u0: np.ndarray, u1: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the rates at both ends of each step, under the inputs there, or their means, (n_states, 2 n_rows)."""
        if self._step is None:
            return self.simulator.rate(*self._both(x, u0, u1, p))
        each = wide(p, self.log.n)
        return np.tile(means(self.simulator, self.log, self._step, x, u0, u1, each, self._exact), 2)

    def _take_fewer_steps(self) -> None:
        """Run over each sample in as few steps as readings can tell from exact ones: each costs four rates a row."""

        def in_steps(count: int) -> np.ndarray:
            self._exact = count
            return self._rates(self._x, self._u, self._ends(self._u), self.simulator.numbers)

        self._exact = fewest(in_steps, self._base_rates, self._untold)
        self._again()

    @property
    def _untold(self) -> np.ndarray:
        """Differences of the rate of each state that its readings do not tell from noise."""
        least = np.full(len(self.simulator.states), np.inf)
        for b in self.balances:
            if b.order:
                noise = window_noise(self.channel_noise(b.channel), self.n, b.order, self.log.dt)
                least[b.row] = min(least[b.row], EXCESS * noise)
        return least

    def _total_rates(
        self, x: np.ndarray, u: np.ndarray, pushed: np.ndarray, p: np.ndarray, restored: bool
    ) -> np.ndarray:
        """Return the rates; where only inputs differ and the rates are linear in them, by superposition."""
        lacking = np.tile(self._rounding @ rounded_off(self.simulator, self.derived, x, self.log), 2)
        return lacking + self._bend + self._rates_at(x, u, pushed, p, restored)

    def _rates_at(self, x: np.ndarray, u: np.ndarray, pushed: np.ndarray, p: np.ndarray, restored: bool) -> np.ndarray:
        start, end = np.hsplit(pushed, 2)
        if p.ndim != 1 or (restored and not self._turns_little(x, p)):
            return self._rates(x, start, end, p)
        change = pushed - np.hstack([self._u, self._ends(self._u)])
        sizes = {k: 2.0 ** np.ceil(np.log2(np.max(np.abs(row)))) for k, row in enumerate(change) if np.any(row)}
        if not all(self._is_straight(k, size) for k, size in sizes.items()):
            return self._rates(x, start, end, p)
        out = self._base(p)
        for k in sizes:
            out = out + self._slope(k, p) * change[k]
        return out + self._by_states(x - self._x) if restored else out

    def _turns_little(self, x: np.ndarray, p: np.ndarray) -> bool:
        """Return whether other readings change the rates as slopes say, or by too little to tell, at some instants."""
        nominal = np.array_equal(p, self.simulator.numbers)
        if self._step is None or not (nominal and self.simulator.one_by_one and np.all(np.isfinite(x))):
            return False
        some = some_instants(self.log.n)
        u0, u1, each = self._u[:, some], self._ends(self._u)[:, some], wide(p, len(some))
        later = self.simulator.own_steps(x[:, some], u0, u1, each, self.log.dt, self._step, self._exact)
        if later is None:
            return False
        exact = (later - x[:, some]) / self.log.dt
        linear = self._base(p)[:, some] + self._by_states(x - self._x)[:, some]
        return all(rms(row) <= much for row, much in zip(exact - linear, self._untold, strict=True))

    def _by_states(self, change: np.ndarray) -> np.ndarray:
        """Return the change of the rates at both ends of each step by a change of the states, to first order."""
        out = np.zeros((len(change), 2 * self.log.n))
        for k in np.flatnonzero(np.any(change, axis=1)).tolist():
            out = out + self._state_slope(k) * np.tile(change[k], 2)
        return out

    def _state_slope(self, k: int) -> np.ndarray:
        """Return the slope of the rates over a state at both ends of each step."""

        def found() -> np.ndarray:
            x, step, p = self._x.copy(), 1e-3 * (float(np.ptp(self._x[k])) or 1.0), self.simulator.numbers
            x[k] += step
            return (self._rates(x, self._u, self._ends(self._u), p) - self._base(p)) / step

        return self._asked.get(("state", k), found)

    def _base(self, p: np.ndarray) -> np.ndarray:
        """Return the rates of the measured motion at both ends of each step; cached for the latest parameters."""
        if np.array_equal(p, self.simulator.numbers):
            return self._base_rates
        return self._asked.get(("base", p.tobytes()), lambda: self._rates(self._x, self._u, self._ends(self._u), p))

    def _slope(self, k: int, p: np.ndarray) -> np.ndarray:
        """Return the slope of the rates over an input at both ends of each step."""

        def found() -> np.ndarray:
            up, ends, step = self._u.copy(), self._ends(self._u).copy(), self._steps[k]
            up[k] += step
            ends[k] += step
            return (self._rates(self._x, up, ends, p) - self._base(p)) / step

        return self._asked.get((k, p.tobytes()), found)

    def _is_straight(self, k: int, size: float) -> bool:
        """Return whether the rates are linear in an input over changes of a size, at some instants."""
        if (k, size) not in self._straight:
            self._straight[k, size] = straight(self.simulator, *self._some(), k, size)
        return self._straight[k, size]

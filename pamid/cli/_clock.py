"""The unit of a clock that states none: as fast as the simulator's states or outputs change, else seconds."""

import contextlib
import math
from dataclasses import replace

import numpy as np

from ..errors import PamidError
from ..signals.guess import Guess
from ..signals.units import UNITS
from ..simulators import ControlSimulator, Simulator
from ..simulators.port_log import PortLog, port_log
from ..systems.draft import Draft

_OF_CLOCKS = ("ns", "us", "ms", "s", "min", "h")
_DAY, _STAMP = 86_400, 1e9
"""What a clock in seconds rarely exceeds; and what it does not if it is called time, as the tidy table's is."""
_NEAR = math.log(5.0)
"""Logarithm of the factor up to which the states change as fast as a simulator's: two units are at least 60 apart."""
_SAME = 0.7
"""Correlation below which a simulator does not say how its states change."""
_HALF = 0.5
"""Share of the outputs' error in seconds below which another unit is right."""
_ROWS = 5_000
_WINDOWS = 50


def count_seconds(draft: Draft) -> None:
    """Take an unstated clock for seconds, as a log is read without a mapping, where no other unit stands out."""
    clock = _open_clock(draft)
    if clock is not None and clock.unit and clock.high < (_STAMP if clock.column == "time" else _DAY):
        _count(draft, "s")


def count_as_simulated(draft: Draft, simulator: Simulator) -> None:
    """Give an unstated clock the unit in which the log changes as fast as a simulator says, if it says it."""
    clock = _open_clock(draft)
    if clock is None:
        return
    with contextlib.suppress(PamidError, NotImplementedError):  # reported where log and simulator are compared
        log = port_log(draft.read(), simulator)
        every = simulator.form == "ode" and set(simulator.states) <= log.channels.keys()
        times = _speed(simulator, log) if every else 0.0
        if isinstance(simulator, ControlSimulator) and not every:
            times = _speed_of_outputs(simulator, log, UNITS[clock.unit or "s"].factor)
        if times:
            factor = times * UNITS[clock.unit or "s"].factor
            near = min(_OF_CLOCKS, key=lambda u: abs(math.log(UNITS[u].factor / factor)))
            if abs(math.log(UNITS[near].factor / factor)) < _NEAR:
                _count(draft, near)


def _open_clock(draft: Draft) -> Guess | None:
    """Return the clock if nobody and no header states its unit."""
    clock = draft.of("time")
    return None if clock is None or clock.sure or clock.why == "given" else clock


def _count(draft: Draft, unit: str) -> None:
    draft.guesses = [replace(g, unit=unit) if g.signal == "time" else g for g in draft.guesses]


def _speed(simulator: Simulator, log: PortLog) -> float:
    """Return how many times too fast the log is read, by the states' changes over stretches; 0 where unknown."""
    found = []
    begin, end = log.spans[0]
    end = min(end, begin + _ROWS)
    x = np.array([log.channels[n] for n in simulator.states]).reshape(-1, log.n)[:, begin:end]
    u = log.inputs(simulator)[:, begin:end]
    numbers = np.repeat(simulator.numbers[:, None], end - begin, axis=1)
    rates = simulator.rate(log.t[begin:end], x, u, numbers)
    cut = np.unique(np.linspace(0, end - begin - 1, _WINDOWS).astype(int))
    along = np.concatenate([np.zeros((len(x), 1)), np.cumsum(0.5 * (rates[:, 1:] + rates[:, :-1]), axis=1)], axis=1)
    for said, read in zip(np.diff(along[:, cut], axis=1) * log.dt, np.diff(x[:, cut], axis=1), strict=True):
        together, size = float(np.sum(said * read)), float(np.sum(said**2) * np.sum(read**2))
        if np.isfinite(size) and size > 0.0 and together > _SAME * math.sqrt(size):
            found.append(together / float(np.sum(said**2)))
    return float(np.median(found)) if found else 0.0


def _speed_of_outputs(simulator: ControlSimulator, log: PortLog, second: float) -> float:
    """Return the same for a linear system by its outputs in each unit, or its own step; 0 where seconds are as good."""
    if not (simulator.states and set(simulator.outputs) & log.channels.keys()):
        return 0.0
    if simulator.step:
        return simulator.step / log.dt if simulator.step != 1.0 else 0.0
    errors = {times: _error(simulator, log, times) for times in (UNITS[u].factor / second for u in _OF_CLOCKS)}
    best = min(errors, key=lambda times: errors[times])
    return best if errors[best] < _HALF * errors[1.0 / second] else 0.0


def _error(simulator: ControlSimulator, log: PortLog, times: float) -> float:
    """Return the error of a linear system's outputs on the first run, in samples so many times as long."""
    from scipy.linalg import expm

    n, end = len(simulator.states), min(log.spans[0][1], _ROWS)
    u, known = log.inputs(simulator)[:, :end], [k for k, name in enumerate(simulator.outputs) if name in log.channels]
    x = np.zeros((end, n, 1 + n))  # from rest, and from each state alone
    x[0, :, 1:] = np.eye(n)
    with np.errstate(all="ignore"):
        step = expm(times * log.dt * np.block([[simulator.A, simulator.B], [np.zeros((len(u), n + len(u)))]]))
        for k in range(end - 1):
            x[k + 1] = step[:n, :n] @ x[k]
            x[k + 1, :, 0] += step[:n, n:] @ u[:, k]
        y = np.concatenate([simulator.C[k] @ x for k in known])
        forced = y[:, 0] + (simulator.D[known] @ u).ravel()
        left = np.concatenate([log.channels[simulator.outputs[k]][:end] for k in known]) - forced
    if not (np.isfinite(y).all() and np.isfinite(left).all()):
        return math.inf
    free = np.linalg.lstsq(y[:, 1:], left, rcond=None)[0]
    return float(np.linalg.norm(left - y[:, 1:] @ free))

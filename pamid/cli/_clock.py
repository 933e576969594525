"""The unit of a clock that states none: as fast as the states change, else seconds where it counts rows one by one."""

import contextlib
import math
from dataclasses import replace

import numpy as np

from ..errors import PamidError
from ..signals.guess import Guess
from ..signals.units import UNITS
from ..simulators import Simulator
from ..simulators.port_log import PortLog, port_log
from ..systems.draft import Draft

_OF_CLOCKS = ("ns", "us", "ms", "s", "min", "h")
_DAY = 86_400
"""Rows beyond which one a second would last longer than a day."""
_NEAR = math.log(5.0)
"""Logarithm of the factor up to which the states change as fast as a simulator's: two units are at least 60 apart."""
_SAME = 0.7
"""Correlation below which a simulator does not say how its states change."""
_ROWS = 5_000
_WINDOWS = 50


def count_seconds(draft: Draft) -> None:
    """Take an unstated clock that counts 0, 1, 2, ... for seconds."""
    if (clock := _open_clock(draft)) is None:
        return
    frame = draft.table.frame
    values = frame.iloc[:, clock.column] if isinstance(clock.column, int) else frame[clock.column]
    t = values.to_numpy(dtype=float, na_value=np.nan)
    steps = np.diff(t[np.isfinite(t)])
    if len(steps) and np.median(steps) == 1.0 and np.nanmax(t) < _DAY and np.all(np.mod(steps, 1.0) == 0.0):
        _count(draft, "s")


def count_as_simulated(draft: Draft, simulator: Simulator) -> None:
    """Give an unstated clock the unit in which the logged states change as fast as a simulator says, if it says it."""
    clock = _open_clock(draft)
    if clock is None or simulator.form != "ode":
        return
    with contextlib.suppress(PamidError, NotImplementedError):  # reported where log and simulator are compared
        log = port_log(draft.read(), simulator)
        if set(simulator.states) <= log.channels.keys() and (times := _speed(simulator, log)):
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

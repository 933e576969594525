"""Columns in another unit or of another sign than their ports: detected by motion, size and the model's response."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import PamidError, UnitWarning
from ..signals.unit_names import unit_name
from ..signals.units import UNITS
from .base import Simulator
from .ports import Port
from .structure import kinematic_pairs

if TYPE_CHECKING:
    from .port_log import PortLog

_FACTOR = 1.5
"""Factor between a rate and its speed that no friction, lag or noise explains, nor a gain that the library tests."""
_GAIN = 5.0
"""The same between an input and its effect: a fault of an actuator is smaller."""
_ALIKE = 0.95
_LEAST = 5_000.0
"""Pa; what a pressure port never exceeds in a whole log is read in bar, kPa or MPa, not in Pa."""
ABOUT, CLOSE = 0.1, 0.02
"""How far a factor may be, in its logarithm, from that of a unit: as a model says it, and as a rate does."""
_COUNTS = 50.0
"""Range beyond which whole numbers are counts rather than settings."""


def tell_unit_doubts(simulator: Simulator, log: PortLog) -> None:
    """Warn, once per simulator, of columns that seem not to be in their port's unit."""
    if getattr(simulator, "_units_told", False):
        return
    simulator._units_told = True  # type: ignore[attr-defined]
    if doubts := unit_doubts(simulator, log):
        warnings.warn(
            f"{'; '.join(doubts)}. Correct the column in the mapping, or its unit or factor.",
            UnitWarning,
            stacklevel=2,
        )


def unit_doubts(simulator: Simulator, log: PortLog) -> list[str]:
    """Return a sentence for each column that seems to be in another unit, of the other sign or in another's place."""
    try:
        return list(_doubts(simulator, log))
    except PamidError:
        return []  # reported where the simulator is actually evaluated


def _beyond_range(simulator: Simulator, log: PortLog) -> Iterator[str]:
    limited = {where for _, where, _ in simulator.effects}
    for name, (low, high) in simulator.ranges().items():
        values, port = log.channels.get(name), simulator.port(name)
        if values is None or not np.isfinite(values).any():
            continue
        least, most = float(np.nanmin(values)), float(np.nanmax(values))
        if least < low - (high - low) or most > high + (high - low):
            angle, times = port.unit == "rad", (high - low) / (most - least) if most > least else np.inf
            if port.kind == "input" and (name in limited or not (angle or _units(port.unit, times, ABOUT))):
                continue  # a command beyond its limit is cut there, which is no mistake of the mapping
            said = f"{name} reads {least:.3g} to {most:.3g}, but its stops allow {low:.3g} to {high:.3g} {port.unit}"
            if angle:
                yield f"{said}: it may be in degrees ({_option(port, ':deg')})"
            else:
                yield said + _ways_out(_Way(port, times, values))


def _doubts(simulator: Simulator, log: PortLog) -> Iterator[str]:
    for name, values in log.channels.items():
        if simulator.port(name).unit == "Pa" and 0.0 < np.nanmax(np.abs(values)) < _LEAST:
            option = _option(simulator.port(name), ":UNIT")
            yield f"{name} looks like bar, kPa or MPa: it is at most {np.nanmax(np.abs(values)):.3g} Pa ({option})"
    yield from _beyond_range(simulator, log)
    if simulator.form != "ode" or not set(simulator.states) <= log.channels.keys():
        return
    x, u = np.array([log.channels[n] for n in simulator.states]).reshape(-1, log.n), log.inputs(simulator)
    some = np.linspace(0, log.n - 1, min(log.n, 50)).astype(int)
    pairs = kinematic_pairs(simulator, log.t[some], x[:, some], u[:, some])
    rates = np.concatenate([np.gradient(x[:, a:b], log.dt, axis=1) for a, b in log.spans if b - a > 2], axis=1)
    rows = np.concatenate([np.arange(a, b) for a, b in log.spans if b - a > 2])
    wrong = set()
    for position, speed in pairs.items():
        k, of = (simulator.states.index(name) for name in (position, speed))
        factor, alike = _factor(x[of][rows], rates[k])
        if alike > _ALIKE and factor < 0.0:
            said = f"or {speed} seems to have the opposite sign: {position} falls where {speed} is positive"
        elif alike > _ALIKE and not 1 / _FACTOR < factor < _FACTOR:
            said = (
                f"or {speed} seems to be in another unit: {position} changes {factor:.4g} times as fast as {speed} says"
            )
            said += _ways_out(
                _Way(simulator.port(position), 1.0 / factor, x[k], CLOSE),
                _Way(simulator.port(speed), factor, x[of], CLOSE),
            )
        elif alike < _ALIKE and _is_rate(x[k][rows], rates[of]):
            said = f"and {speed} seem to be exchanged: {position} is the rate of {speed}"
        else:
            continue
        wrong |= {position, speed}
        yield f"{position} {said}"
    if wrong:
        return
    p = np.repeat(np.asarray(simulator.numbers, dtype=float)[:, None], len(rows), axis=1)
    whole = simulator.rate(log.t[rows], x[:, rows], u[:, rows], p)
    exchanged = _exchanged(
        simulator, lambda drive: simulator.rate(log.t[rows], x[:, rows], drive, p), u[:, rows], whole, rates
    )
    if exchanged:
        yield exchanged
        return
    for k, name in enumerate(simulator.inputs):
        without = u[:, rows].copy()
        without[k] = 0.0
        rest = simulator.rate(log.t[rows], x[:, rows], without, p)
        does, seen = whole - rest, rates - rest
        i = int(np.argmax(np.std(does, axis=1)))
        factor, alike = _factor(does[i], seen[i])
        if alike > _ALIKE and factor < 0.0:
            option = _option(simulator.port(name), "*-1")
            said = f"{name} seems to have the opposite sign: {simulator.states[i]} moves against it"
            yield f"{said} ({option} reverses it)"
        elif alike > _ALIKE and not 1 / _GAIN < factor < _GAIN:
            yield (
                f"{name} seems to be in another unit: {simulator.states[i]} moves as if it were {factor:.3g} times "
                f"as large{_ways_out(_Way(simulator.port(name), factor, u[k]))}"
            )


def _exchanged(
    simulator: Simulator, rate: Callable[[np.ndarray], np.ndarray], u: np.ndarray, whole: np.ndarray, seen: np.ndarray
) -> str:
    """Return a sentence on two inputs of one unit whose columns, exchanged, move every state as it is seen to move."""
    names = simulator.inputs
    pairs = [
        (i, j)
        for i, j in combinations(range(len(names)), 2)
        if simulator.port(names[i]).unit == simulator.port(names[j]).unit and np.any(u[i] != u[j])
    ]
    if not pairs:
        return ""
    rest = rate(np.zeros_like(u))

    def explains(found: np.ndarray) -> bool:
        told = [_factor(a, b) for a, b in zip(found - rest, seen - rest, strict=True) if np.ptp(a) > 0.0]
        return bool(told) and all(alike > _ALIKE and 1 / _GAIN < factor < _GAIN for factor, alike in told)

    if not explains(whole):
        for i, j in pairs:
            other = u.copy()
            other[[i, j]] = u[[j, i]]
            if explains(rate(other)):
                what = "in the log, each moves what the other drives in the simulator"
                return f"{names[i]} and {names[j]} seem to be exchanged: {what}"
    return ""


def _is_rate(x: np.ndarray, rate: np.ndarray) -> bool:
    """Return whether a reading is the rate of another."""
    factor, alike = _factor(x, rate)
    return alike > _ALIKE and 1 / _FACTOR < factor < _FACTOR


def _factor(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return the slope of y over x about their means, and how alike they are."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good] - np.mean(x[good]), y[good] - np.mean(y[good])
    both = float(np.sqrt((x @ x) * (y @ y)))
    if len(x) < 20 or not both > 0.0:
        return 1.0, 0.0
    return float(y @ y / (x @ y)) if x @ y else np.inf, abs(float(x @ y)) / both


class _Way(NamedTuple):
    """A column whose values times a factor may be those of its port."""

    port: Port
    times: float
    values: np.ndarray
    within: float = ABOUT
    """How far the factor may be off, in its logarithm."""


def _ways_out(*ways: _Way) -> str:
    """Return the units that factors suggest and the text to write; without any, the text of the factors."""
    likely, plain = [], []
    for port, times, values, within in ways:
        found, factor = _units(port.unit, times, within), _option(port, f"*{times:.3g}")
        if found:
            likely.append(f"{port.name} may be in {' or '.join(found)} ({_option(port, f':{found[0]}')})")
        elif np.ptp(values) > _COUNTS and np.array_equal(values, np.round(values)):
            likely.append(f"{port.name}, in whole numbers, may be counts of a converter ({factor})")
        plain.append(factor)
    return f": {' or '.join(likely)}" if likely else f" ({' or '.join(plain)} converts it)"


def _option(port: Port, how: str) -> str:
    """Return how to say a column's unit or factor."""
    return f"pamid init --signal '{port.source}=COLUMN{how}'"


def _units(unit: str, times: float, within: float) -> list[str]:
    """Return at most two units whose readings times a factor are in a port's unit, the nearest first."""
    own = UNITS.get(unit_name(unit) or "") if unit not in ("", "-") else None
    if own is None:
        return []
    off: dict[float, str] = {}  # names of one unit differ in spelling alone: the first counts
    for name, other in UNITS.items():
        if other.dimension == own.dimension and other.factor != own.factor:
            off.setdefault(abs(float(np.log(other.factor / (own.factor * times)))), name)
    return [off[apart] for apart in sorted(off) if apart < within][:2]

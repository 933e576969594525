"""Columns in another unit than their ports: detected by motion, size and the model's response."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..errors import PamidError, UnitWarning
from .base import Simulator
from .structure import kinematic_pairs

if TYPE_CHECKING:
    from .port_log import PortLog

_FACTOR = 2.0
"""Factor between a rate and its speed that no friction, lag or noise explains."""
_GAIN = 5.0
"""The same between an input and its effect: a fault of an actuator is smaller."""
_ALIKE = 0.95
_LEAST = 5_000.0
"""Pa; what a pressure port never exceeds in a whole log is read in bar, kPa or MPa, not in Pa."""
_KNOWN = (
    (180 / np.pi, "degrees for rad"), (30 / np.pi, "rpm for rad/s"), (1e3, "mm for m, or mV for V"), (1e2, "cm or %"),
    (10.0, "mm for cm"), (1e-5, "bar for Pa"), (1e-3, "kPa for Pa"), (1e-6, "MPa for Pa"), (3.6, "km/h for m/s"),
)  # fmt: skip


def tell_unit_doubts(simulator: Simulator, log: PortLog) -> None:
    """Warn, once per simulator, of columns that seem not to be in their port's unit."""
    if getattr(simulator, "_units_told", False):
        return
    simulator._units_told = True  # type: ignore[attr-defined]
    try:
        doubts = list(_doubts(simulator, log))
    except PamidError:
        return  # reported where the simulator is actually evaluated
    if doubts:
        warnings.warn(
            f"{'; '.join(doubts)}. Give the column's unit in its name, in the mapping or at the port.",
            UnitWarning,
            stacklevel=2,
        )


def _doubts(simulator: Simulator, log: PortLog) -> Iterator[str]:
    for name, values in log.channels.items():
        if simulator.port(name).unit == "Pa" and 0.0 < np.nanmax(np.abs(values)) < _LEAST:
            yield f"{name} looks like bar, kPa or MPa: it is at most {np.nanmax(np.abs(values)):.3g} Pa"
    if simulator.form != "ode" or not set(simulator.states) <= log.channels.keys():
        return
    x, u = np.array([log.channels[n] for n in simulator.states]).reshape(-1, log.n), log.inputs(simulator)
    some = np.linspace(0, log.n - 1, min(log.n, 50)).astype(int)
    pairs = kinematic_pairs(simulator, log.t[some], x[:, some], u[:, some])
    rates = np.concatenate([np.gradient(x[:, a:b], log.dt, axis=1) for a, b in log.spans if b - a > 2], axis=1)
    rows = np.concatenate([np.arange(a, b) for a, b in log.spans if b - a > 2])
    wrong = set()
    for position, speed in pairs.items():
        v, rate = x[simulator.states.index(speed)][rows], rates[simulator.states.index(position)]
        factor, alike = _factor(v, rate)
        if alike > _ALIKE and not 1 / _FACTOR < abs(factor) < _FACTOR:
            wrong |= {position, speed}
            yield (
                f"{position} or {speed} seems to be in another unit: {position} changes {abs(factor):.4g} times as "
                f"fast as {speed} says{_word(abs(factor))}"
            )
    if wrong:
        return
    p = np.repeat(np.asarray(simulator.numbers, dtype=float)[:, None], len(rows), axis=1)
    whole = simulator.rate(log.t[rows], x[:, rows], u[:, rows], p)
    for k, name in enumerate(simulator.inputs):
        without = u[:, rows].copy()
        without[k] = 0.0
        rest = simulator.rate(log.t[rows], x[:, rows], without, p)
        does, seen = whole - rest, rates - rest
        i = int(np.argmax(np.std(does, axis=1)))
        factor, alike = _factor(does[i], seen[i])
        if alike > _ALIKE and factor > 0.0 and not 1 / _GAIN < factor < _GAIN:
            yield (
                f"{name} seems to be in another unit: {simulator.states[i]} moves as with {factor:.3g} times its values"
                f"{_word(1.0 / factor)}"
            )


def _factor(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return the slope of y over x about their means, and how alike they are."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good] - np.mean(x[good]), y[good] - np.mean(y[good])
    both = float(np.sqrt((x @ x) * (y @ y)))
    if len(x) < 20 or not both > 0.0:
        return 1.0, 0.0
    return float(y @ y / (x @ y)) if x @ y else np.inf, abs(float(x @ y)) / both


def _word(factor: float) -> str:
    """Return the unit that a factor suggests; empty if none."""
    near = [word for known, word in _KNOWN if abs(np.log(factor / known)) < 0.1]
    back = [f"the other way round, {word}" for known, word in _KNOWN if abs(np.log(factor * known)) < 0.1]
    found = near or back
    return f", as {found[0]}" if found else ""

r"""The exchange between two ends of a simulator, and each end's response: from the simulator's own rates.

Action equals reaction, so the mutual influence of two ends on their rates is symmetric up to their masses (capacities),

.. math:: m_i\,\frac{\partial \dot x_i}{\partial x_j} = \pm\, m_j\,\frac{\partial \dot x_j}{\partial x_i}

with the plus between ends of one kind (a spring, a damper, a pipe, a wall) and the minus between a pressure and the
speed of its piston. The rates of any simulator hence give :math:`m_i / m_j`, and :math:`m` where a parameter is known
as one of the masses.

References
----------
D. C. Karnopp, D. L. Margolis, R. C. Rosenberg, "System Dynamics", 5th ed., Wiley, 2012, chapters 3 and 4 (bond graphs:
reciprocal fields, gyrators and transformers).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..signals.units import UNITS
from .base import Simulator
from .dimensions import unit_powers
from .structure import spread_numbers

STEP = 1e-4
"""Share of a state's range by which it is moved: differences both ways are exact to its square."""
SAME = 1e-4
"""Relative difference below which two numbers from such differences are equal."""
NOTHING = 1e-9
"""Share of the largest slope of a rate below which a slope is rounding."""
MOSTLY = 0.98
"""Share of instants at which a sign must hold: at the others something may be at a stop."""
_MASSES: Mapping[str, dict[str, int]] = {
    "N": {"kg": 1}, "N m": {"kg": 1, "m": 2}, "W": {"J": 1, "K": -1}, "m^3/s": {"m": 2},
}  # fmt: skip


def factor_of(unit: str) -> float:
    """Return the factor to SI of a unit or its rate; 1 if unknown."""
    if unit in UNITS:
        return float(UNITS[unit].factor)
    return factor_of(unit.removesuffix("/s")) if unit.endswith("/s") else 1.0


class SomeInstants(NamedTuple):
    """Where a simulator is asked."""

    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    """Times, states, inputs. Shape (n,)."""
    step: np.ndarray
    """Step of each state, shape (n_states,)."""

    @classmethod
    def of(cls, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> SomeInstants:
        """Return instants with steps that are small relative to the states' ranges."""
        size = np.ptp(x, axis=1) if x.shape[1] else np.zeros(len(x))
        top = np.max(np.abs(x), axis=1, initial=0.0)
        return cls(t, x, u, STEP * np.where(size > 0.0, size, np.where(top > 0.0, top, 1.0)))


def slopes(simulator: Simulator, at: SomeInstants, by: list[int], p: np.ndarray | None = None) -> np.ndarray:
    """Return the slopes of all rates over some states, in SI, shape (n_states, n_by, n)."""
    n, m = at.x.shape[1], len(by)
    p = spread_numbers(simulator, n) if p is None else p
    x = np.tile(at.x, 2 * m)
    for k, i in enumerate(by):
        x[i, 2 * k * n : (2 * k + 1) * n] += at.step[i]
        x[i, (2 * k + 1) * n : (2 * k + 2) * n] -= at.step[i]
    with np.errstate(all="ignore"):
        found = simulator.rate(np.tile(at.t, 2 * m), x, np.tile(at.u, 2 * m), np.tile(p, 2 * m))
    out = found.reshape(len(at.x), m, 2, n)
    units = np.array([factor_of(simulator.port(s).unit) for s in simulator.states])
    change = (out[:, :, 0] - out[:, :, 1]) / (2.0 * at.step[by])[None, :, None]
    return np.asarray(change * units[:, None, None] / units[by][None, :, None])


class Mass(NamedTuple):
    """A parameter that is the mass, inertia or capacity of a state."""

    row: int
    """Its place among the parameters."""
    value: float
    """Its number in the simulator."""
    unit: str
    """Unit of the force or flow that it resists."""

    def of(self, p: np.ndarray) -> np.ndarray:
        """Return its number among parameters, shape (n_parameters, n)."""
        return np.asarray(p[self.row])


class Slopes:
    """Slopes of a simulator's rates over its states, in SI, at some instants."""

    def __init__(self, simulator: Simulator, at: SomeInstants) -> None:
        self.simulator, self.at = simulator, at
        self.J = slopes(simulator, at, list(range(len(simulator.states))))
        ranges = (at.step * [factor_of(simulator.port(s).unit) for s in simulator.states])[None, :, None]
        change = np.abs(self.J) * ranges
        self.there = np.mean(change > NOTHING * np.max(change, axis=(1, 2), keepdims=True), axis=2) > MOSTLY

    def of(self, state: str, by: str) -> np.ndarray | None:
        """Return the slope of a state's rate over another state at each instant; None where it is zero."""
        names = self.simulator.states
        if state not in names or by not in names:
            return None
        i, k = names.index(state), names.index(by)
        return self.J[i, k] if self.there[i, k] else None

    def constant(self, ratio: np.ndarray) -> bool:
        """Return whether a ratio of slopes is the same at all instants."""
        middle = float(np.median(ratio))
        return bool(np.mean(np.abs(ratio - middle) <= SAME * abs(middle)) > MOSTLY)

    def where_equal(self, first: str, second: str) -> np.ndarray | None:
        """Return the ratio of two states' mutual slopes where both are equal; None where one of them is zero there."""
        rows, x = [self.simulator.states.index(s) for s in (first, second)], self.at.x.copy()
        factors = [factor_of(self.simulator.port(s).unit) for s in (first, second)]
        x[rows[1]] = x[rows[0]] * factors[0] / factors[1]
        J = slopes(self.simulator, self.at._replace(x=x), rows)[rows]
        return J[0, 1] / J[1, 0] if np.all(J[1, 0] * J[0, 1] > 0.0) else None

    def mass(self, state: str, by: str) -> Mass | None:
        """Return the parameter that is the mass (inertia, capacity) of a state."""
        plain = self.of(state, by)
        if plain is None:
            return None
        i, k = self.simulator.states.index(state), self.simulator.states.index(by)
        for row, (name, p) in enumerate(self.simulator.parameters.items()):
            unit = next((u for u, powers in _MASSES.items() if unit_powers(p.unit) == powers), "")
            if not unit or not p.value > 0.0:
                continue
            heavier = self.simulator.with_({name: 2.0 * p.value})
            half = slopes(heavier, self.at, [k])[i, 0]
            if np.mean(np.abs(2.0 * half - plain) <= SAME * np.abs(plain)) > MOSTLY:
                return Mass(row, float(p.value), unit)
        return None

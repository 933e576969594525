r"""Steps by which a log was integrated: what a simulator of others does within a sample is no cause of a gap.

Euler's method with steps h follows, to first order in h, the rates of a slightly earlier state (modified equation),

.. math:: \dot x = f - \tfrac{h}{2} f' f \approx f\bigl(x(t - \tfrac{h}{2}), u(t)\bigr), \qquad 0 \le h \le \Delta t

which takes damping away. Where a speed is the derivative of a position, :math:`v = \dot x + \tfrac{h}{2} a` and so

.. math:: \ddot x = a\bigl(x(t - h), \dot x(t - \tfrac{h}{2}), u\bigr)

A step as long as a sample is followed exactly instead. Speeds are differences of positions, so that for Euler's method,
and for the semi-implicit one, whose positions go with the new speed,

.. math::
    \frac{x_{k+1} - 2 x_k + x_{k-1}}{\Delta t^2} = a\Bigl(x_{k-1}, \frac{x_k - x_{k-1}}{\Delta t}, u_{k-1}\Bigr)
    \quad\text{or}\quad a\Bigl(x_k, \frac{x_k - x_{k-1}}{\Delta t}, u_k\Bigr)

The residuals change by :math:`s c_1 + s^2 (c - c_1)` if c is what a whole sample does, :math:`c_1` the same to first
order, and s the step in samples. The method that fits best is taken, its step fitted once for the whole simulator, like
a parameter with a tolerance. It is free where it explains the log to its noise: beside causes it would only make their
sizes uncertain. It is never below zero, as that of an implicit method would be: there it would hide damping that a
simulator lacks.

A model that says its own step, as MuJoCo's do, may have made a log, or its rig may know no steps. Its positions go with
the new speed (semi-implicit Euler), so that a speed derived from them lies half a step aside,

.. math:: \ddot x = a\bigl(x(t), \dot x(t \mp \tfrac{h}{2}), u\bigr)

which is worth :math:`\tfrac{h}{2}` times the damping in mass: it is allowed beside causes, too. Its step is that of
its integrator: the speed is half a step late, and damping that it takes implicitly follows the new speed, which adds
inertia, :math:`a_h = a - h M^{-1} D a`, by as much as one step of the model shows.

References
----------
E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd ed., Springer, 2006, chapter IX.
https://doi.org/10.1007/3-540-30666-8
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ...simulators.port_log import PortLog
from .balance import Balance
from .between_rows import OWN_STEP, SEMI_IMPLICIT, STEPS, WHOLE, after, before
from .tolerances import SMALL


def earlier(x: np.ndarray, by: np.ndarray | float, log: PortLog) -> np.ndarray:
    """Return signals as they were some samples earlier, shape (n_signals, n_rows)."""
    return x - np.reshape(by, (-1, 1)) * 0.5 * (after(x, log) - before(x, log))


def within_steps(
    base: np.ndarray, at_late: Callable[[np.ndarray], np.ndarray], at_once: Callable[[bool], np.ndarray],
    states: Sequence[str], derived: Sequence[str], balances: Sequence[Balance], log: PortLog, own: float,
    bend: np.ndarray, implicit: np.ndarray,
) -> Iterator[tuple[str, np.ndarray]]:  # fmt: skip
    """Yield changes of the rates within each step, shape (n_states, 2 n_rows), which are not causes."""
    dynamic = [b for b in balances if b.order and not b.velocity]  # clocks of two readings have a skew of their own
    apart = np.array([float(name in derived) for name in states])
    # Positions go with the new speed if the model says its step; else that is asked where a speed is a derivative.
    methods = (
        [SEMI_IMPLICIT] if own > 0.0 else [STEPS, SEMI_IMPLICIT] if any(b.order == 2 for b in dynamic) else [STEPS]
    )
    for method in methods:
        out = np.zeros_like(base)
        for order in sorted({b.order for b in dynamic}):
            rows = [b.row for b in dynamic if b.order == order]
            late = at_late(0.5 * SMALL * (apart if method == SEMI_IMPLICIT and order == 2 else order - apart))
            out[rows] = (late - base)[rows] / SMALL + implicit[rows]
        yield method, out
        if not own > 0.0:
            rate, out = at_once(method == SEMI_IMPLICIT), np.zeros_like(base)
            for b in dynamic:
                # Ends of the steps around a row whose mean, as `Balance.mean` weighs them, is the rate of one of them.
                ends = (1.0, 1.0) if b.order == 1 else (4.0, -2.0) if method == SEMI_IMPLICIT else (-2.0, 4.0)
                out[b.row] = np.outer(ends, rate[b.row]).ravel() - base[b.row] - bend[b.row]
            yield method + WHOLE, out
    if own > 0.0 and derived:
        late = at_late(0.5 * SMALL * apart)
        for b in (b for b in dynamic if b.order == 2):  # of each, damping may be implicit or not
            out = np.zeros_like(base)
            out[b.row] = min(own / log.dt, 1.0) * (late - base)[b.row] / SMALL
            yield f"{OWN_STEP} in {b.channel}", out
    if own > 0.0:
        yield "bend within steps", bend

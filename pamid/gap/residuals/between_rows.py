"""Inputs between the rows of a log: a controller holds them, measured ones are interpolated.

Over a step the two differ by half of the input's change. Where sampling is slow for the motion, that is more than many
causes contribute, and a file does not say which it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...effects import Effect
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog
from .protocol import Active

PIECES = 8
"""Pieces of a step in which what effects make of a held input is followed: the mean of a lag of half a step is exact to
2e-3."""
TIMINGS = "timing", "bend", "start"
"""What is not known of an input: when and how it acts within a sample, and what it was before a run."""
STEPS = "step of the integrator"
"""Name of the parameter: 0 for no step, 1 for one as long as a sample."""
SEMI_IMPLICIT = f"{STEPS}, semi-implicit"
"""The same of a method whose positions go with the new speed."""
METHODS = {STEPS: "Euler's method", SEMI_IMPLICIT: "the semi-implicit Euler method"}
WHOLE = ", all of it"
"""Ending of the name of what a step as long as a sample does; the name alone means to first order."""
OWN_STEP = "step of the model"
"""The same of a model that says its step: 1 for it, -1 for an implicit one."""
NOTE = "Inputs are interpolated between rows, which explains the log better than holding them over each step does."


def steps_taken(deviations: Mapping[str, float], dt: float) -> list[str]:
    """Return a sentence for each step of an integrator that a fit took up; a model's own is known."""
    told = []
    for name, share in deviations.items():
        method = next((m for m in reversed(METHODS) if name.startswith(m)), None)
        if method and (size := round(share, 2)) > 0.0:
            day = name.removeprefix(method)
            told.append(
                f"The log{day} looks as if it had been integrated by {METHODS[method]} in steps of "
                f"{1e3 * share * dt:.2g} ms ({size:g} of a sample). The fit allows for these steps; "
                "they do not count as a cause."
            )
    return told


def drawn(u: np.ndarray, starts: np.ndarray, stairs: bool = False) -> np.ndarray:
    r"""Return inputs whose lines, or means over each step, act like smooth ones through the rows.

    Of a wave, lines leave :math:`1 - (\omega h)^2 / 12`, means of lines :math:`(\omega h)^2 / 24` less.
    """
    out = u.copy()
    bend = u[:, 2:] - 2.0 * u[:, 1:-1] + u[:, :-2]
    for a in starts:
        bend[:, max(a - 2, 0) : a] = 0.0  # rows do not cross runs
    out[:, 1:-1] -= (1.0 / 8.0 if stairs else 1.0 / 12.0) * bend
    return out


def driven(place: Placement, made: Effect, u: np.ndarray, dt: float, starts: np.ndarray, held: bool) -> np.ndarray:
    """Return an input after an effect: at the rows, or the mean over each step if held."""
    if not held or not made.n_states or made.sampled:
        return place.drive(made, u, dt, starts)
    y = place.drive(made, np.repeat(u, PIECES), dt / PIECES, PIECES * starts).reshape(-1, PIECES)
    end = 2.0 * y[:, -1] - y[:, -2]  # its value before the input jumps
    return np.asarray((y.sum(axis=1) + 0.5 * (end - y[:, 0])) / PIECES)


def read_between(place: Placement, made: Effect, x: np.ndarray, dt: float, starts: np.ndarray) -> np.ndarray:
    """Return what a sensor reads at the rows of a smooth signal: one with memory follows it between them, too."""
    if not made.n_states:
        return place.reading(made, x, dt, starts)
    return place.reading(made, curved(x, starts), dt / PIECES, PIECES * starts)[::PIECES]


def curved(x: np.ndarray, starts: np.ndarray) -> np.ndarray:
    r"""Return a signal in pieces of each step, a parabola of the least bend, the last row of a run held.

    The error is :math:`O(h^3)`.
    """
    bend, last = least_bend(x, starts), np.append(starts[1:], len(x)) - 1
    after, share = np.append(x[1:], x[-1:]), np.arange(PIECES) / PIECES
    after[last] = x[last]
    return (x[:, None] + share * (after - x)[:, None] - 0.5 * share * (1.0 - share) * bend[:, None]).ravel()


def least_bend(x: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return the second difference in each step by its rows and a neighbour, the one that bends less.

    Where an input jumps, motion has a corner, and is smooth on either side.
    """
    last = np.append(starts[1:], len(x)) - 1
    bend = np.full(len(x), np.inf)
    bend[1:-1] = x[2:] - 2.0 * x[1:-1] + x[:-2]
    bend[starts] = bend[last] = np.inf  # rows do not cross runs
    there = np.append(bend[1:], np.inf)
    bend = np.where(np.abs(bend) < np.abs(there), bend, there)
    bend[~np.isfinite(bend)] = 0.0
    bend[last] = 0.0
    return bend


def passed_on(
    active: Active, u: np.ndarray, inputs: Sequence[str], log: PortLog, held: bool, rested: bool = False
) -> np.ndarray:
    """Return inputs as the effects on them pass them on, each as `driven` has it; `rested` if zero before each run."""
    starts, count = log.starts, len(log.starts)
    if rested:
        u, starts = np.insert(u, starts, 0.0, axis=1), starts + np.arange(count)
    for place, made in active:
        if place.enters == "input" and not place.acts:
            k, u = list(inputs).index(place.at), u.copy()
            u[k] = driven(place, made, u[k], log.dt, starts, held)
    return np.delete(u, starts, axis=1) if rested else u


def timings(
    active: Active, u: np.ndarray, inputs: Sequence[str], log: PortLog, held: bool
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the inputs that effects pass on with what is not known of one.

    One acts half a sample early, is bent by a third of its second difference, or was zero before each run.
    """
    begun = passed_on(active, u, inputs, log, held, rested=True)
    u = passed_on(active, u, inputs, log, held)
    for name, change in zip(TIMINGS, (*_shifted_and_bent(u, log), begun - u), strict=True):
        for k, of in enumerate(inputs):
            if np.ptp(u[k]) > 0.0:
                moved = u.copy()
                moved[k] += change[k]
                yield f"{name} of {of}", moved


def _shifted_and_bent(u: np.ndarray, log: PortLog) -> tuple[np.ndarray, np.ndarray]:
    """Return the change of inputs by half a sample, and by a third of their second difference."""
    there, back = after(u, log), before(u, log)
    return 0.25 * (there - back), (there - 2.0 * u + back) / 3.0


def timed(u: np.ndarray, deviations: Mapping[str, float], inputs: Sequence[str], log: PortLog) -> np.ndarray:
    """Return inputs as a fit has them act within a sample."""
    changes, out = _shifted_and_bent(u, log), u.copy()
    for name, change in zip(TIMINGS, changes, strict=False):
        out += np.array([[deviations.get(f"{name} of {of}", 0.0)] for of in inputs]) * change
    return out


def needed(
    columns: Mapping[str, np.ndarray], u: np.ndarray, inputs: Sequence[str], log: PortLog
) -> dict[str, np.ndarray]:
    """Return the columns of `timings` that a fit needs: also what does nothing until an effect remembers it."""
    begun = {f"{TIMINGS[-1]} of {name}" for name, row in zip(inputs, u, strict=True) if np.any(row[log.starts])}
    return {k: v for k, v in columns.items() if (np.any(v) or k in begun) and np.all(np.isfinite(v))}


def before(x: np.ndarray, log: PortLog) -> np.ndarray:
    """Return each row's predecessor within its run; the first row stays."""
    out = np.roll(x, 1, axis=1)
    out[:, log.starts] = x[:, log.starts]
    return out


def after(x: np.ndarray, log: PortLog) -> np.ndarray:
    """Return each row's successor within its run; the last row stays."""
    out, last = np.roll(x, -1, axis=1), [b - 1 for _, b in log.spans]
    out[:, last] = x[:, last]
    return out

r"""Where a motion turns between two rows, dry friction changes its sign there, not at the next row.

A force that is interpolated between rows misses that by up to the whole friction in the one step, and follows the path
half a step late. Steps in which a motion turns are therefore followed in pieces. Over each of them the force is
replaced by the line with the same mean and first moment, and as the weak form weighs a step with lines, the residuals
are those of the pieces: the line goes from a to b with

.. math:: a = 4 m_0 - 6 m_1, \qquad b = 6 m_1 - 2 m_0, \qquad m_i = \int_0^1 s^i f(s)\,\mathrm{d}s
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...effects import Effect
from ...simulators.placement import Placement
from ...simulators.port_log import PortLog
from .between_rows import PIECES, after, least_bend
from .derived import with_what_lacks

Signals = Mapping[str, np.ndarray]
_SHARES = np.arange(PIECES + 1) / PIECES


class CutSteps:
    """The rows of a log with further instants where a path turns between two of them."""

    def __init__(self, path: np.ndarray, velocity: np.ndarray, log: PortLog) -> None:
        self.log, moved, later = log, after(path[None], log)[0] - path, after(velocity[None], log)[0]
        self._bend = 0.5 * log.dt * (later - velocity)
        # Speeds that miss the way of a step place a turn in it no better than by chance, 1/sqrt(12) of a step. Where an
        # input jumps, the path bends on one side of it.
        lost = np.abs(moved - 0.5 * log.dt * (later + velocity)) > np.abs(self._bend) / np.sqrt(3.0)
        self._bend[lost] = 0.5 * least_bend(path, log.starts)[lost]
        # A parabola turns within the step if it bends by more than it moves.
        self.cut = np.flatnonzero(np.abs(moved) < np.abs(self._bend))
        pieces = np.ones(log.n, int)
        pieces[self.cut] = PIECES
        self.first = np.cumsum(pieces) - pieces
        self._row = np.repeat(np.arange(log.n), pieces)
        self._share = (np.arange(len(self._row)) - self.first[self._row]) / pieces[self._row]
        self.times = self.along(log.t)

    @property
    def starts(self) -> np.ndarray:
        """The first instant of each run."""
        return self.first[self.log.starts]

    def along(self, x: np.ndarray) -> np.ndarray:
        """Return a signal at all instants, linear between rows."""
        return x[self._row] + self._share * (after(x[None], self.log)[0] - x)[self._row]

    def path(self, x: np.ndarray) -> np.ndarray:
        """Return a path at all instants, its speed linear between rows."""
        return self.along(x) - self._share * (1.0 - self._share) * self._bend[self._row]

    def at_both_ends(self, f: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a force at the rows, and its values at the start and end of each step."""
        rows = f[self.first]
        start, end = rows.copy(), after(rows[None], self.log)[0]
        if len(self.cut):
            inside = f[self.first[self.cut][:, None] + np.arange(PIECES)]
            start[self.cut], end[self.cut] = lines(np.hstack([inside, end[self.cut][:, None]]))
        return rows, start, end


def lines(f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return start and end of the lines with the mean and first moment of forces at all pieces of a step, last axis."""
    a, b, s = f[..., :-1], f[..., 1:], _SHARES[:-1]
    mean = np.sum(0.5 * (a + b), axis=-1) / PIECES
    moment = np.sum(0.5 * (a + b) * s + (a / 6.0 + b / 3.0) / PIECES, axis=-1) / PIECES
    return 4.0 * mean - 6.0 * moment, 6.0 * moment - 2.0 * mean


def force_at_both_ends(
    place: Placement, made: Effect, found: Signals, speed: str, derived: Mapping[str, str], log: PortLog
) -> tuple[np.ndarray, np.ndarray]:
    """Return the force of an effect at the rows, and at both ends of each step."""
    step = log.dt * place.scales.time
    if made.path_dependent and speed in found:
        path = place.follows["position"]
        steps = CutSteps(found[path], found[speed], log)
        follows = {name: steps.along(found[name]) for name in place.follows.values()} | {path: steps.path(found[path])}
        s = place.signals(follows, steps.times)
        inside = place.force(made, s, made.trace(s, place.plant, step, steps.starts))
        rows, start, end = steps.at_both_ends(np.broadcast_to(inside, steps.times.shape).astype(float))
        return rows, np.concatenate([start, end])
    velocity = place.follows.get("velocity", "")
    position = next((q for q, v in derived.items() if v == velocity), "")
    s = place.signals(found, log.t)
    memory = made.trace(s, place.plant, step, log.starts)

    def force(v: np.ndarray) -> np.ndarray:
        at = place.signals({**found, velocity: v}, log.t) if velocity else s
        return np.broadcast_to(place.force(made, at, memory), (log.n,)).astype(float)

    known = found.get(velocity, log.t)
    rows = with_what_lacks(force, found[position], known, log) if position else force(known)
    return rows, np.concatenate([rows, after(rows[None], log)[0]])

"""Stretches of a log of one clock as one run: many short runs cost no more than a long one.

Each stretch is filled up to whole windows by holding its last sample, and laid behind the one before. Filters, memories
and windows begin again at each; no window reaches into the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .run import Model, Run, Tested
from .stretch import Stretch
from .windows import Windows

ROWS = 16_384
"""Rows of a joined run: what a processor keeps at hand of a few columns."""


class JoinedRun(Run):
    """Several stretches of a log compared with a simulator, concatenated."""

    def __init__(self, parts: Sequence[Run], model: Model, stretch: Stretch | None = None) -> None:
        self.parts = list(parts)
        super().__init__(_joined(self.parts) if stretch is None else stretch, model)

    def under(self, model: Model) -> JoinedRun:
        """Return the same stretches compared with another simulator."""
        return JoinedRun(self.parts, model, self.stretch)

    @property
    def starts(self) -> np.ndarray:
        """First row of each stretch."""
        return np.array([begin for begin, _ in self._places()])

    def _places(self) -> Iterator[tuple[int, int]]:
        """Yield the first row of each stretch, and the first one after its readings."""
        begin = 0
        for part in self.parts:
            yield begin, begin + len(part.time)
            begin += _whole(len(part.time), self.n)

    def _windows(self, equation: Tested) -> Windows:
        first, parts, m = [], [], 0
        for (begin, _), part in zip(self._places(), self.parts, strict=True):
            own = part.windows(equation)
            first.append(own.first + begin)
            parts.append(slice(m, m + len(own.first)))
            m += len(own.first)
        return Windows(self.n, equation.order, np.concatenate(first), len(self.time), parts=tuple(parts))

    def _smoothed(self, x: np.ndarray, deriv: int) -> np.ndarray:
        out = [super(JoinedRun, self)._smoothed(x[a:b], deriv) for a, b in self._places()]
        return np.concatenate([_filled(y, self.n) for y in out])

    def _played(self, x: np.ndarray) -> np.ndarray:
        places = zip(self._places(), self.parts, strict=True)
        return np.concatenate([_filled(part._played(x[a:b]), self.n) for (a, b), part in places])


def joined(runs: Sequence[Run], model: Model) -> Iterator[tuple[Run, range]]:
    """Join neighbouring stretches that share a clock and channels and lack no sample."""
    first = 0
    for k in range(1, len(runs) + 1):
        rows = sum(len(run.time) for run in runs[first:k])
        if k == len(runs) or rows >= ROWS or not _alike(runs[first], runs[k]):
            part = runs[first:k]
            yield (JoinedRun(part, model) if len(part) > 1 else part[0]), range(first, k)
            first = k


def _alike(a: Run, b: Run) -> bool:
    whole = not a.stretch.bridges and not b.stretch.bridges
    return whole and a.dt == b.dt and set(a.stretch.readings) == set(b.stretch.readings)


def _joined(parts: Sequence[Run]) -> Stretch:
    n = parts[0].n
    time = np.concatenate([_filled(part.time, n) for part in parts])
    readings = {
        name: np.concatenate([_filled(part.stretch.readings[name], n) for part in parts])
        for name in parts[0].stretch.readings
    }
    return Stretch("", time, parts[0].dt, readings, noises=dict(parts[0].stretch.noises))


def _whole(rows: int, n: int) -> int:
    return -(-rows // n) * n


def _filled(x: np.ndarray, n: int) -> np.ndarray:
    """Return a series that holds its last sample up to whole windows."""
    return np.concatenate([x, np.repeat(x[-1:], _whole(len(x), n) - len(x), axis=0)])

"""What a sensor with memory makes of jumps at unknown instants: it holds their noise for longer, and smaller."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable

import numpy as np

from ...remembered import Remembered
from .influence import Influence
from .jumps import unknown_instants
from .predictions import PredictedEvidence
from .protocol import Active, Spec
from .response import Drive
from .window_noise import REPLICATES


class LateJumps(PredictedEvidence, ABC):
    """Predictions in which inputs may jump between rows and sensors may have memory."""

    _growths: Remembered[np.ndarray]
    _jumped: Remembered[tuple[np.ndarray, np.ndarray]]

    @abstractmethod
    def _compared(
        self, about: Active, active: Active, predictions: Iterable[np.ndarray], influence: Influence | None = None
    ) -> np.ndarray:
        """Return the change of the residuals from predictions to others, less what initial states explain."""

    @abstractmethod
    def _influence(self, slopes: np.ndarray) -> Influence:
        """Return how initial states act on the windows."""

    def _under_inputs(self, u: np.ndarray, active: Active | None = None) -> np.ndarray:
        """Return the change of the residuals under other inputs, to first order, as faulty sensors read it."""
        active, numbers = self._own if active is None else active, self.simulator.numbers
        base = self._drive(self._own, numbers)

        def made() -> tuple[np.ndarray, np.ndarray]:
            return self._near(self._x0, base, Drive(base.u + u - self._u, base.p, self._own, self.lines))

        near = [self._fold(rows).copy() for rows in self._jumped.get(hash(u.tobytes()), made)]
        slopes = self._as_read(self._x0, active, numbers)
        return self._compared(active, active, near, None if slopes is None else self._influence(slopes))

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return the growth of each window's noise where sensors read late what jumps; None without such sensors."""
        late = self._late(self.active(spec))
        if not late or not self._opened:
            return None

        def made() -> np.ndarray:
            more = [
                unknown_instants(jump, off, lambda change: self._under_inputs(self._u + change, late), REPLICATES)
                for jump, off, _ in self._opened
            ]
            shares = [(np.square(m) - np.square(known)) / np.square(self.noise)
                      for m, (*_, known) in zip(more, self._opened, strict=True)]  # fmt: skip
            return np.sqrt(np.maximum(1.0 + np.sum(shares, axis=0), np.finfo(float).eps))

        return self._growths.get(repr([(place.key, made.values) for place, made in late]), made)

    def _lay_again(self) -> None:
        self._growths.clear()
        super()._lay_again()

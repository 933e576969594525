"""A log whose readings of one motion are compared with each other, without the simulator's forces."""

from __future__ import annotations

import numpy as np

from .balance import Balance
from .between_rows import after
from .direct import DirectEvidence


class KinematicEvidence(DirectEvidence):
    """Residuals between readings of the same motion, in which no force of the simulator enters."""

    how = "between readings of the same motion"

    def _balances(self) -> list[Balance]:
        return [b for b in super()._balances() if b.velocity]

    def _rates(self, x: np.ndarray, u0: np.ndarray, u1: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the rates of positions, which are the velocities: the simulator need not be asked."""
        ends, states = np.hstack([x, after(x, self.log)]), list(self.simulator.states)
        out = np.zeros_like(ends)
        for position, velocity in self.pairs.items():
            out[states.index(position)] = ends[states.index(velocity)]
        return out

    def _accelerations(self) -> np.ndarray:
        """Return the simulator's rates: what a drive does within a step is no disagreement of two readings."""
        return super()._rates(self._x, self._u, self._ends(self._u), self.simulator.numbers)

    def _run_within_steps(self) -> None:
        """Leave readings as they are: no simulator enters."""

    def _outputs(self, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.zeros((len(self.simulator.outputs), self.log.n))

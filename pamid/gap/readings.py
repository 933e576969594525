"""Two readings of one motion, compared with each other before a fault of either may explain a force.

A logged position and a logged velocity are redundant. A gain, lag or delay of one of them shows where they are compared
with each other, without the simulator: what does not show there is not a cause of the gap, and a disagreement that no
fault explains is their noise.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..simulators.base import Simulator
from ..simulators.port_log import PortLog
from .inference.competition import Competition
from .residuals.balance import Balance
from .residuals.between_rows import after
from .residuals.direct import DirectEvidence
from .residuals.kinematic import both_measured
from .residuals.ports import PortEvidence
from .residuals.states import pairs_of
from .settings import CLOSE, CLOSE_SHARE


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


def settled(
    evidence: PortEvidence, log: PortLog, simulator: Simulator, library: Sequence[str], say: Callable[[str], None]
) -> list[str]:
    """Return the library without the faults of readings that another reading of the same motion contradicts."""
    if simulator.form != "ode" or not (pairs := both_measured(pairs_of(simulator, log), log)):
        return list(library)
    if evidence.runs_within_steps:  # what the readings show of one motion takes the simulator then
        return list(library)
    say("compare readings of the same motion")
    between = KinematicEvidence(log, simulator, {})
    # What all readings of a motion have in common shows in none of their differences.
    some = [k for k in library if len(evidence.placements[k].readings) == 1]
    faults = [k for k in some if between.touched([k])]
    competition = Competition(between, faults)
    if competition.enough(competition.base):
        admitted, left = set(), np.ones(len(between.equations))
    else:
        outcome = competition.run()
        if competition.interrupted:  # of the gap nothing is known yet
            raise KeyboardInterrupt
        behind = CLOSE + CLOSE_SHARE * (outcome.best.score - outcome.base.score)
        near = [h for some in outcome.alternatives.values() for h in some if h.score > outcome.best.score - behind]
        admitted, left = set().union(*(h.names for h in [outcome.best, *near])), outcome.best.left
    evidence.widen(dict(zip(between.equations, np.maximum(left, 1.0).tolist(), strict=True)))
    if refused := [k for k in faults if k not in admitted]:
        named = ", ".join(f"{x} and {v}" for x, v in pairs.items())
        shown = f" but for {', '.join(sorted(admitted))}" if admitted else ""
        evidence.notes.append(
            f"The readings {named} agree{shown}: faults of these sensors that would make them disagree are excluded."
        )
    return [k for k in library if k not in set(refused)]

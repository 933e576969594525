"""A log whose readings of one motion are compared with each other, a simulator's forces left aside."""

from __future__ import annotations

from .balance import Balance
from .direct import DirectEvidence


class KinematicEvidence(DirectEvidence):
    """Residuals between readings of the same motion, in which no force of the simulator enters."""

    how = "between readings of the same motion"

    def _balances(self) -> list[Balance]:
        return [b for b in super()._balances() if b.velocity]

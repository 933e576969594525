"""What a diagnosis asks of a log whose states are all known: their sizes, and signals by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from ...simulators.sizes import SignalSizes
from .states import integral, roles_of
from .undone import UndoneEvidence


class MotionSignals(UndoneEvidence, ABC):
    """Residuals of a log that holds the motion, with what there is to know of its signals."""

    _table: dict[str, np.ndarray]
    pushes: dict[tuple[str, str], float]

    @property
    @abstractmethod
    def says_forces(self) -> bool:
        """Whether residuals are converted to forces."""

    def _survey(self, gaps: Mapping[str, float]) -> SignalSizes:
        log, spans = self.log, {name: float(np.ptp(x)) for name, x in self._table.items()}
        for j in self.joints:
            if not j.position:
                spans[f"{j.name}.path"] = float(np.ptp(integral(self._table[j.velocity], log)))
        readings = list(dict.fromkeys(n for b in self.balances for n in (b.channel, b.velocity) if n))
        tops, lows = ({k: float(of(x)) for k, x in self._table.items()} for of in (lambda x: np.max(np.abs(x)), np.min))
        if self.says_forces:  # as the rates that they cause
            push = {j.name: abs(self.pushes.get((j.through, j.velocity), 1.0)) for j in self.joints}
            gaps = {name: gap * push.get(name, 1.0) for name, gap in gaps.items()}
        return SignalSizes(
            spans, tops, lows, gaps, readings, self.pushes, self.joints, log.usual_seconds, log.dt, self.feeds,
            again=log.again,
        )  # fmt: skip

    def signals(self) -> dict[str, np.ndarray]:
        """Return all signals at each row of the log, by name."""
        inputs = dict(zip(self.simulator.inputs, self._u, strict=True))
        return {**{k: v for k, v in self._table.items() if "." not in k}, **inputs}

    def roles(self, equation: str) -> dict[str, str]:
        """Return for an equation the signal of each name of the state, where there is one."""
        return roles_of(self.simulator, self.joints, equation)

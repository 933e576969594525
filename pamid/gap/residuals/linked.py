"""Paths of joints and across pairs of them, and the pairs of ports of a simulator on a log."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from ...signals.paths import turns_back
from ...simulators.damped import at_levers, levers_of
from ...simulators.links import Link, links_of
from ...simulators.sizes import SignalSizes
from ...simulators.structure import JointPort, some_instants
from .port_signals import PortSignals
from .states import integral

UNTURNED = -12.0
"""Logarithm of the odds of an effect that follows a path alone which was never seen to turn back."""


class Paths(PortSignals, ABC):
    """The paths along a log that effects at joints, and between two, depend on."""

    joints: list[JointPort]
    links: Sequence[Link] = ()
    _turning: dict[str, bool]

    @abstractmethod
    def _survey(self, gaps: Mapping[str, float]) -> SignalSizes:
        """Return the sizes of the signals."""

    def _surveyed(self, gaps: Mapping[str, float]) -> SignalSizes:
        """Return the sizes of the signals, and of the differences across two ports."""
        signals, simulator, some = self.signals(), self.simulator, some_instants(self.log.n)
        names = (simulator.states, simulator.inputs)
        logged = [np.array([signals[n] for n in some_of if n in signals]).reshape(-1, self.log.n) for some_of in names]
        whole = [len(rows) for rows in logged] == [len(some_of) for some_of in names]
        x, u = (rows[:, some] for rows in logged)
        x = x if whole and len(x) else np.zeros((len(simulator.states), 0))
        levers = levers_of(simulator, self.joints, self.log.t[some], x, u)
        self.joints = at_levers(levers, self.joints, self.log.t[some], x, u)
        self.links = links_of(simulator, self.joints, levers, self.log.t[some], x, u)
        survey = self._survey(gaps)
        spans = {name: float(np.ptp(self.path_of(name))) for link in self.links for name in link.sources}
        limited = simulator.limited(*logged) if x.size else {}
        return survey._replace(spans={**survey.spans, **spans}, links=self.links, limited=limited)

    def driven(self) -> dict[str, np.ndarray]:
        """Return the inputs that the log holds."""
        return {n: self.log.channels[n] for n in self.simulator.inputs if n in self.log.channels}

    def _turns(self, path: str) -> bool:
        """Return whether a path reverses at least once per run."""
        if path not in self._turning:
            self._turning[path] = turns_back(self.path_of(path), self.log.starts)
        return self._turning[path]

    def path_of(self, name: str) -> np.ndarray:
        """Return the path that an effect follows: a position, the integral of a speed alone, or a difference of two."""
        signals = self.signals()
        if name in signals:
            return signals[name]
        for link in self.links:
            if name in link.sources:
                first, second = map(self.path_of, link.sources[name])
                return first - link.ratio * second
        return integral(signals[self.speeds[name]], self.log)

    @property
    def speeds(self) -> dict[str, str]:
        """The speeds of the joints that have no position, by the names of their paths."""
        return {f"{j.name}.path": j.velocity for j in self.joints if not j.position}

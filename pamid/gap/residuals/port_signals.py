"""The signals of a simulator's ports at each window, and the paths of joints and across pairs of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...signals.paths import turns_back
from ...simulators.base import Simulator
from ...simulators.damped import at_levers, levers_of
from ...simulators.links import Link, links_of
from ...simulators.port_log import PortLog
from ...simulators.sizes import SignalSizes
from ...simulators.structure import JointPort, some_instants
from .protocol import STATE
from .states import integral

UNTURNED = -12.0
"""Logarithm of the odds of an effect that follows a path alone which was never seen to turn back."""


class PortWindows(NamedTuple):
    """The windows of one equation."""

    equation: str
    """Its name: the port that it tests."""
    unit: str
    """Unit of its residual."""
    first: np.ndarray
    """Rows of the log at which the windows begin."""
    centre: np.ndarray
    """Rows at their centres."""
    measured: np.ndarray
    """What was measured, in the equation's unit."""


class PortSignals(ABC):
    """What residuals at ports say of the state at their windows, and of the paths that effects at joints depend on."""

    simulator: Simulator
    log: PortLog
    equations: list[str]
    parts: list[slice]
    value: np.ndarray
    centre: np.ndarray
    joints: list[JointPort]
    links: Sequence[Link] = ()
    _turning: dict[str, bool]

    @abstractmethod
    def roles(self, equation: str) -> dict[str, str]:
        """Return for an equation the signal behind each name of `STATE`, as far as there is one."""

    @abstractmethod
    def signals(self) -> dict[str, np.ndarray]:
        """Return every signal at each row."""

    @property
    def state(self) -> dict[str, np.ndarray]:
        """The state at each window, by the names of `STATE`; NaN where it has none."""
        signals = self.signals()
        out = {name: np.full(len(self.value), np.nan) for name in STATE}
        for equation, part in zip(self.equations, self.parts, strict=True):
            for name, signal in self.roles(equation).items():
                out[name][part] = signals[signal][self.centre[part]]
        return out

    def column(self, name: str, side: int = 0) -> str:
        """Return the user's name of a signal of the state."""
        return self.roles(self.equations[side]).get(name, name) if side < len(self.equations) else name

    def told(self, equation: str) -> dict[str, np.ndarray]:
        """Return what tells a reader where the windows of an equation lie, at all windows and NaN at those of others.

        States that stand only inside the model say nothing: its reading does, in their place.
        """
        names, signals = list(dict.fromkeys(self.roles(equation).values())), self.signals()
        hidden = {*self.simulator.hidden_states, *self.undetermined()}
        shown = [n for n in names if n in self.log.channels or n not in hidden]
        if len(shown) < len(names) and equation in self.log.channels:
            shown.append(equation)
        part, every = self.parts[self.equations.index(equation)], {**self.log.channels, **signals}
        found = {name: np.full(len(self.value), np.nan) for name in shown}
        for name in shown:
            found[name][part] = every[name][self.centre[part]]
        return found

    def undetermined(self) -> list[str]:
        """Return the states that stand in for readings, but that these do not determine."""
        return []

    # --- paths -------------------------------------------------------------------------------------------------
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

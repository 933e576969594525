"""The signals of a simulator's ports at each window, by the names that a diagnosis has for them."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ...simulators.base import Simulator
from ...simulators.port_log import PortLog
from .protocol import STATE


class PortSignals(ABC):
    """What residuals at ports say of the state at their windows."""

    simulator: Simulator
    log: PortLog
    equations: list[str]
    parts: list[slice]
    value: np.ndarray
    centre: np.ndarray

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
        shown = [n for n in names if n in self.log.channels or n not in self.simulator.hidden_states]
        if len(shown) < len(names) and equation in self.log.channels:
            shown.append(equation)
        part, every = self.parts[self.equations.index(equation)], {**self.log.channels, **signals}
        found = {name: np.full(len(self.value), np.nan) for name in shown}
        for name in shown:
            found[name][part] = every[name][self.centre[part]]
        return found

"""Effects that a bench has only in some of its logs: what appeared, grew or was repaired between two logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects import Effect, all_effects
from ...simulators.placement import named

FROM, UNTIL = "@from ", "@until "
MOST_DAYS = 4
"""Number of days up to which a cause may begin or end at each border; with more, only the causes found are compared log
by log."""
CHANGES = 0.1
"""Probability that a cause acts in only some of the logs."""


class Variants:
    """The library with effects that act from one log on, or up to one.

    Parameters
    ----------
    library : sequence of str
        Effects that may be causes.
    logs : sequence of str
        Names of the logs, in the order in which they were recorded.
    days : sequence of str
        The day of each: within a day nothing changes.
    """

    def __init__(self, library: Sequence[str], logs: Sequence[str], days: Sequence[str]) -> None:
        self.logs = list(logs)
        self.effects: dict[str, type[Effect]] = {}
        self._plain: dict[str, str] = {}
        self._acts: dict[str, range] = {}
        n, known = len(self.logs), all_effects()
        borders = [k for k in range(1, n) if days[k] != days[k - 1]]
        if 0 < len(borders) < MOST_DAYS:
            odds = float(np.log(CHANGES / (1.0 - CHANGES) / (2.0 * len(borders))))
            for name in library:
                for k in borders:
                    self._add(known[name], f"{name}{FROM}{k + 1}", range(k, n), odds)
                    self._add(known[name], f"{name}{UNTIL}{k}", range(k), odds)
        self.library = [*library, *self.effects]

    def _add(self, effect: type[Effect], key: str, where: range, odds: float) -> None:
        self.effects[key] = named(effect, key, prior=effect.prior + odds)
        self._plain[key], self._acts[key] = effect.name, where

    def plain(self, name: str) -> str:
        """Return the library's name of an effect."""
        return self._plain.get(name, name)

    def acts(self, name: str, k: int) -> bool:
        """Return whether an effect acts in a log."""
        return name not in self._acts or k in self._acts[name]

    def when(self, name: str) -> tuple[str, str] | None:
        """Return how an effect changes, ``"appears"`` or ``"goes"``, and from which log on; None if it stays."""
        if name not in self._acts:
            return None
        where = self._acts[name]
        return ("appears", self.logs[where.start]) if where.start else ("goes", self.logs[where.stop])

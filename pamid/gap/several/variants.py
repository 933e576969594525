"""Effects that a bench has only in some of its logs: what appeared, grew or was repaired between two logs."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...effects import Effect

FROM, UNTIL = "@from ", "@until "
MOST_DAYS = 4
"""Number of days up to which a cause may begin or end at each border; with more, only the causes found are compared log
by log."""
CHANGES = 0.1
"""Probability that a cause acts in only some of the logs."""


def odds_of_change(borders: int) -> float:
    """Return the logarithm of the odds with which an effect acts on one side only of one of so many borders."""
    return float(np.log(CHANGES / (1.0 - CHANGES) / (2.0 * max(borders, 1))))


class Variants:
    """The library with effects that act from one log on, or up to one."""

    def __init__(
        self, library: Sequence[str], known: Mapping[str, type[Effect]], logs: Sequence[str], days: Sequence[str]
    ) -> None:
        self.logs, n = list(logs), len(logs)
        self.names: dict[str, str] = {}
        """The library's name of each effect that acts in some of the logs."""
        self._acts: dict[str, range] = {}
        borders = [k for k in range(1, n) if days[k] != days[k - 1]]
        self.odds = odds_of_change(len(borders))
        """Logarithm of the odds with which an effect acts in some of the logs."""
        self.apart: dict[str, list[tuple[str, str]]] = {}
        """The two halves of each effect about each border, before and after it."""
        if 0 < len(borders) < MOST_DAYS:
            for name in library:
                self.apart[name] = [(f"{name}{UNTIL}{k}", f"{name}{FROM}{k + 1}") for k in borders]
                for k, (before, after) in zip(borders, self.apart[name], strict=True):
                    self.names |= {after: name, before: name}
                    self._acts |= {after: range(k, n), before: range(k)}
        self.library = [*library, *self.names]
        self.effects = {**known, **{key: known[name] for key, name in self.names.items()}}
        """The effects of the library, and those that act in some of the logs, by name."""

    def plain(self, name: str) -> str:
        """Return the library's name of an effect."""
        return self.names.get(name, name)

    def acts(self, name: str, k: int) -> bool:
        """Return whether an effect acts in a log."""
        return name not in self._acts or k in self._acts[name]

    def when(self, name: str) -> tuple[str, str] | None:
        """Return how an effect changes, ``"appears"`` or ``"goes"``, and from which log on; None if it stays."""
        if name not in self._acts:
            return None
        where = self._acts[name]
        return ("appears", self.logs[where.start]) if where.start else ("goes", self.logs[where.stop])

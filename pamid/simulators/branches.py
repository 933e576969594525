"""Functions that branch on numbers, asked for many instants at once: apart for those that take different branches."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np


class Parting(BaseException):
    """A condition that holds at some instants only; no error, so that no function catches it as one."""

    def __init__(self, holds: np.ndarray) -> None:
        super().__init__()
        self.holds = holds


class ManyWaysError(Exception):
    """A function takes so many different ways that asking for many instants at once saves no time."""


class Instants(np.ndarray):
    """Numbers at many instants; a function that branches on them parts them."""

    def __bool__(self) -> bool:
        if self.size == 1 or self.ndim != 1:
            return bool(np.asarray(self))
        holds = np.asarray(self).astype(bool)
        if holds.all() or not holds.any():
            return bool(holds[0])
        raise Parting(holds)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Return what a function of numpy does, still at many instants: `where`, `interp` and others forget that."""
        found = super().__array_function__(func, types, args, kwargs)
        return found.view(type(self)) if type(found) is np.ndarray and found.ndim else found


Rows = slice | np.ndarray


def by_branches(ask: Callable[[Any], None], n: int, most: int, known: Sequence[Rows] = (slice(None),)) -> list[Rows]:
    """Ask for all of n instants, or for parts of them that take the same branches; return the parts.

    Where they are known from other numbers, only those are parted that have changed since.

    Raises
    ------
    ManyWaysError
        If there are more parts than `most`.
    """
    waiting, parts = [*known], list[Rows]()
    while waiting:
        if len(parts) + len(waiting) > most:
            raise ManyWaysError
        rows = waiting.pop()
        try:
            ask(rows)
        except Parting as way:
            at = np.arange(n)[rows]
            waiting += [at[way.holds], at[~way.holds]]
        else:
            parts.append(rows)
    return parts


class Branches:
    """What is asked for many instants at once again and again, in the parts that took the same branches last time."""

    def __init__(self) -> None:
        self._n, self._parts = 0, list[Rows]()
        self.fewest = 1
        """Parts when they were last looked for among all instants."""

    def ask(self, ask: Callable[[Any], None], n: int, most: int) -> None:
        """Ask for all of n instants, as `by_branches` does."""
        if n == self._n and self._parts:
            with contextlib.suppress(ManyWaysError):  # from where too much has changed
                self._parts = by_branches(ask, n, min(most, 2 * self.fewest), self._parts)
                return
        self._n, self._parts, self.fewest = n, [], n
        self._parts = by_branches(ask, n, most)
        self.fewest = len(self._parts)

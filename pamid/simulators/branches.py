"""Functions that branch on numbers, asked for many instants at once: apart for those that take different branches."""

from __future__ import annotations

from collections.abc import Callable
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


def by_branches(ask: Callable[[Any], None], n: int, most: int) -> int:
    """Ask for all of n instants, or for parts of them that take the same branches; return how many parts.

    Raises
    ------
    ManyWaysError
        If there are more parts than `most`.
    """
    try:
        ask(slice(None))
    except Parting as way:
        waiting, parts = [np.flatnonzero(way.holds), np.flatnonzero(~way.holds)], 0
        while waiting:
            if parts + len(waiting) > most:
                raise ManyWaysError from None
            rows = waiting.pop()
            try:
                ask(rows)
                parts += 1
            except Parting as way:
                waiting += [rows[way.holds], rows[~way.holds]]
        return parts
    return 1

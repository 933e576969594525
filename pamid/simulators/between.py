"""Two ports that an effect can act between, as a user names them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import MissingParameterError, ParameterError, SimulatorSyntaxError
from ..names import refuse_others

AND = " and "
"""Separator between the names of two ports in a place written as one text."""


@dataclass(frozen=True)
class Between:
    """Two joints or two chambers with effects between them, which depend on their difference and act on both.

    Parameters
    ----------
    first, second : str
        Joints (a joint port, its position or its velocity) or chambers (a chamber port or its level).
    ratio : float, optional
        Travel of the first per travel of the second, such as a gear ratio: across them is x₁ − ratio · x₂. By default
        what the simulator's own coupling says, else 1.
    inertia : tuple of (str, str), optional
        What turns the rate at each end into a force or flow: a mass, an inertia, a capacity; a number or a formula
        of the simulator's parameters and states, in SI. By default what the simulator's own coupling says.

    Raises
    ------
    ParameterError
        Both ends are the same, or a ratio is zero or not a number.

    Examples
    --------
    >>> from pamid.simulators import Between
    >>> Between("motor", "load", ratio=50).name
    'motor and load'
    """

    first: str
    second: str
    ratio: float | None = None
    inertia: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        if not self.first or not self.second or self.first == self.second:
            raise ParameterError(
                f"The ends are {self.first!r} and {self.second!r}.", "the names of two ports", "Name both ends."
            )
        if self.ratio is not None and not (math.isfinite(self.ratio) and self.ratio != 0.0):
            raise ParameterError(f"ratio is {self.ratio!r}.", "a number that is not 0", "Write a number.")

    @property
    def name(self) -> str:
        """Both ends as one text."""
        return f"{self.first}{AND}{self.second}"


def place_name(at: Any) -> str | None:
    """Return where an effect acts as one text: a port, or two; None where it says neither."""
    if isinstance(at, str):
        return at
    if isinstance(at, (list, tuple)) and len(at) == 2 and all(isinstance(end, str) for end in at):
        return AND.join(at)
    return None


def ends_of(where: str) -> tuple[str, str] | None:
    """Return the two ends that a place names; None where it is one port."""
    first, found, second = where.partition(AND)
    return (first, second) if found else None


def read_between(given: Any) -> list[Between]:
    """Return the entries ``[[between]]`` of a simulator file."""
    if not isinstance(given, list) or not all(isinstance(b, dict) for b in given):
        raise SimulatorSyntaxError("between is not a list of tables.", "[[between]]", "Write one [[between]] each.")
    return [_between(b) for b in given]


def _between(given: Mapping[str, Any]) -> Between:
    refuse_others(given, ("ends", "ratio", "inertia"), "[[between]] has")
    ends, ratio, inertia = given.get("ends"), given.get("ratio"), given.get("inertia")
    if not isinstance(ends, list) or place_name(ends) is None:
        raise MissingParameterError(f"ends of [[between]] is {ends!r}.", 'ends = ["A", "B"]', "Name two ports.")
    if ratio is not None and (isinstance(ratio, bool) or not isinstance(ratio, (int, float))):
        raise SimulatorSyntaxError(f"ratio of [[between]] is {ratio!r}.", "a number", "Write a number.")
    if inertia is None:
        return Between(ends[0], ends[1], ratio)
    two = isinstance(inertia, list) and len(inertia) == 2
    if not two or not all(isinstance(x, (str, int, float)) and not isinstance(x, bool) for x in inertia):
        raise SimulatorSyntaxError(
            f"inertia of [[between]] is {inertia!r}.", 'two numbers or formulas, such as ["Jm", "Jl"]', "Write both."
        )
    return Between(ends[0], ends[1], ratio, (str(inertia[0]), str(inertia[1])))

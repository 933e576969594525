"""Columns that a simulator file names for states and outputs, and that a log lacks: mistyped, or not recorded."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Sequence

from ..errors import SimulatorWarning
from .ports import RESERVED, Port

_ALIKE = 0.7
"""Likeness from which a column may be the one that was meant."""


def closest(name: str, columns: Sequence[str], ports: Sequence[Port]) -> list[str]:
    """Return the columns of no other port that are named almost so, the most alike first."""
    taken = {p.source.casefold() for p in ports if p.source != name and p.source in columns} | set(RESERVED)
    free = {c.casefold(): c for c in columns if c.casefold() not in taken}
    return [free[c] for c in difflib.get_close_matches(name.casefold(), free, n=3, cutoff=_ALIKE)]


def meant(lacking: Sequence[str], columns: Sequence[str], ports: Sequence[Port]) -> str:
    """Return which columns may be meant by names that a log lacks; empty where none is alike."""
    near = {name: found for name in lacking if (found := closest(name, columns, ports))}
    return "".join(f" By {name}, is {' or '.join(found)} meant?" for name, found in near.items())


def notes_of_absent(columns: Sequence[str], ports: Sequence[Port]) -> list[str]:
    """Return a note for each reading whose column a log lacks; warn if a column is named almost like it."""
    lost = [p for p in ports if p.kind in ("output", "state") and p.column and p.column not in columns]
    notes = [
        f"The log lacks the column {p.column} that the simulator file names for {p.name}: {p.name} counts as not "
        f"logged.{meant([p.column], columns, ports)}"
        for p in lost
    ]
    for text in notes:
        if text.endswith("?"):
            warnings.warn(text, SimulatorWarning, stacklevel=3)
    return notes

"""What is above the rows of a text table: a preamble of another width, names of columns, a row of units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..unit_names import unit_name

_ALIKE = 3  # rows that have to look like samples before the first of them counts as one


class Heading(NamedTuple):
    """The rows above the samples."""

    names: tuple[str, ...]
    rows: int


def heading_of(rows: Sequence[Sequence[str]], is_value: Callable[[str], bool]) -> Heading | None:
    """Find the names below a preamble, and the units below the names."""
    width = Counter(len(row) for row in rows).most_common(1)[0][0]
    if width < 2:
        return None

    def is_sample(row: Sequence[str]) -> bool:
        return len(row) == width and sum(map(is_value, row)) >= max(1, (width + 1) // 2)

    first = next((k for k in range(len(rows)) if all(map(is_sample, rows[k : k + _ALIKE]))), 0)

    def is_names(k: int) -> bool:
        return 0 <= k < first and len(rows[k]) == width and not any(is_value(t) for t in rows[k] if t) and any(rows[k])

    if not is_names(first - 1):
        return None
    units = [unit_name(_bare(t)) for t in rows[first - 1]]
    told = [t for t in rows[first - 1] if t]
    if is_names(first - 2) and sum(u is not None for u in units) >= max(1, (len(told) + 1) // 2):
        names = [
            f"{name} [{_bare(unit)}]" if unit and name else name
            for name, unit in zip(rows[first - 2], rows[first - 1], strict=True)
        ]
        return Heading(tuple(names), first)
    return Heading(tuple(rows[first - 1]), first) if first > 1 else None


def _bare(text: str) -> str:
    """Return a unit without the brackets around it."""
    return text.strip().removeprefix("[").removeprefix("(").removesuffix("]").removesuffix(")").strip()

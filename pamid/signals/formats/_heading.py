"""What stands above the rows of a text table: a preamble of other width, names of columns, a row of their units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..unit_names import unit_name

_ALIKE = 3  # rows that have to look like samples before the first of them counts as one


class Heading(NamedTuple):
    """The rows above the samples.

    Parameters
    ----------
    names : tuple of str
        Names of the columns, with the unit in brackets where a row of units names one.
    rows : int
        How many rows stand above the samples, names and units among them.
    """

    names: tuple[str, ...]
    rows: int


def heading_of(rows: Sequence[Sequence[str]], is_value: Callable[[str], bool]) -> Heading | None:
    """Find names below a preamble, and units below names.

    Parameters
    ----------
    rows : sequence of sequences of str
        The first rows of the file, cut into fields without blanks and quotes.
    is_value : callable
        Whether a field is a number or stands for a missing one.

    Returns
    -------
    Heading or None
        None where the first row holds the names, or the table has none: nothing but the plain way is needed then.

    Examples
    --------
    >>> from pamid.signals.formats._heading import heading_of
    >>> rows = [["Log", "rig"], ["Zeit", "Druck", "Kraft"], ["s", "bar", "N"], *(["0", "1", "2"] for _ in range(5))]
    >>> heading_of(rows, str.isdigit)
    Heading(names=('Zeit [s]', 'Druck [bar]', 'Kraft [N]'), rows=3)
    """
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

"""Likeness of log columns and simulator ports: name, role, unit and range as separate clues."""

from __future__ import annotations

import difflib
import math
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

from ..signals.headers import read_header
from ..signals.unit_names import unit_name
from ..signals.units import UNITS
from .ports import Port
from .words import DIMENSIONS_OF, EFFORT, INPUT, ROLE_OF, SYMBOLS_OF, dimensions_of, names_itself, roles_of, tokens

_MARKS = "*'′"
EXACT, ROLE, QUANTITY, NAME, ORDER, UNIT = 6.0, 1.0, 1.0, 2.0, 1.5, 1.0
"""Weights of the clues: a port's own name outweighs all others together."""


@dataclass(frozen=True)
class Column:
    """Content of a column's header."""

    name: str
    """The header."""
    words: tuple[str, ...]
    """Words of its name, without role, quantity and unit."""
    commanded: bool
    measured: bool
    apart: bool
    """Whether it is marked as a command, a reading, or as an error or a setting, which is neither."""
    dimensions: frozenset[str]
    """Dimensions that its unit or its words say; empty where they say none."""
    unit: str
    """Its unit as `pamid.signals.UNITS` names it; empty where it states none."""
    certain: bool
    """Whether the unit is unambiguous."""
    series: str
    number: int
    """Its name with a mark for the last number in it, and that number; -1 where it has none."""
    symbols: frozenset[str]
    """Dimensions that its letters often stand for."""
    leads: bool = False
    """Whether its samples lead those of another column, as a command leads its reading."""

    @property
    def dimension(self) -> str:
        """Dimension of its unit; empty where it states none."""
        return UNITS[self.unit].dimension if self.unit else ""


@dataclass(frozen=True)
class Place:
    """A port as it may appear in a log."""

    port: Port
    """The port."""
    words: tuple[str, ...]
    """What it names, without role and quantity."""
    dimensions: frozenset[str]
    """Dimensions that a column of it may have; empty where any may be."""

    @property
    def commanded(self) -> bool:
        """Whether it is an input."""
        return self.port.kind == "input"

    @property
    def dimension(self) -> str:
        """Dimension of its unit; empty where it is a plain number or not known."""
        return dimension(self.port.unit)


def dimension(unit: str) -> str:
    """Return the dimension of a unit; empty where it is a plain number or not known."""
    found = unit_name(unit) if unit not in ("", "-") else None
    return UNITS[found].dimension if found else ""


def columns_of(names: Sequence[str], telling: Set[str] = frozenset()) -> list[Column]:
    """Return the content of headers; a role's word that every column of several quantities bears says nothing."""
    said = {w for name in names for w in tokens(name)}
    acted = {"act": "action"} if said & {"obs", "observation"} else {}  # not "actual"
    found = [column_of(name, telling=telling, meant=acted) for name in names]
    spoken: dict[frozenset[str], list[set[str]]] = {}
    for c in found:
        if c.dimensions and not c.apart:
            spoken.setdefault(c.dimensions, []).append(set(tokens(c.name)) & set(ROLE_OF))
    shared = [words[0].intersection(*words) for words in spoken.values()]
    some = [words[0].union(*words) - words[0].intersection(*words) for words in spoken.values()]
    silent = {w for w, n in Counter(w for words in shared for w in words).items() if n > 1} - set().union(*some)
    return [column_of(name, silent, telling, acted) for name in names] if silent else found


def column_of(
    name: str, silent: Set[str] = frozenset(), telling: Set[str] = frozenset(), meant: Mapping[str, str] | None = None
) -> Column:
    """Return the content of a header: words without a role, words that distinguish ports, and full forms."""
    header = read_header(name)
    unit = header.unit if header.unit not in (None, "1", "-") else ""  # a 1 in brackets counts columns
    letters = unit.isalpha() and len(unit) == 1
    if unit and not header.bracketed and tokens(name)[-1] in ROLE_OF:  # kp is a gain
        unit = ""
    certain = bool(unit) and (header.bracketed or not letters)
    words = [(meant or {}).get(w, w) for w in tokens(" ".join(header.words) if certain else name)]
    numbers = [k for k, w in enumerate(words) if w.isdigit()]
    series = " ".join("#" if numbers and k == numbers[-1] else w for k, w in enumerate(words))
    roles = roles_of(w for w in words if w not in silent)
    return Column(
        name,
        tuple(w for w in words if names_itself(w) or w in telling),
        "command" in roles,
        "reading" in roles,
        "error" in roles,
        frozenset((UNITS[unit].dimension,)) if certain else dimensions_of(words),
        unit,
        certain,
        series if numbers else "",
        int(words[numbers[-1]]) if numbers and len(words[numbers[-1]]) < 7 else -1,
        frozenset().union(*(SYMBOLS_OF.get(w, ()) for w in words)),
    )


def places_of(ports: Sequence[Port], driven: Set[str]) -> tuple[list[Place], frozenset[str]]:
    """Return ports by their possible log names, and the words of quantities that alone distinguish some of them."""
    bare = [_place(p, p.name in driven) for p in ports]
    found = []
    for place in bare:
        alike = [p for p in bare if (p.commanded, p.dimensions) == (place.commanded, place.dimensions)]
        hidden = any(set(place.words) <= set(p.words) for p in alike if p is not place)
        found.append(replace(place, words=tuple(tokens(place.port.name))) if hidden else place)
    names = {w for place in found for w in place.words}
    return found, frozenset(w for w in names if not names_itself(w) and w in DIMENSIONS_OF)


def _place(port: Port, drives: bool = False) -> Place:
    """Return a port; a joint's input without a unit is an effort of any kind."""
    words = tokens(port.name)
    found = frozenset((dimension(port.unit),)) if dimension(port.unit) else dimensions_of(words)
    if drives and not found:
        found = dimensions_of(("effort",))
    return Place(port, tuple(w for w in words if names_itself(w)) or tuple(words), found)


def is_named(place: Place, column: Column) -> bool:
    """Return whether a column is named like a port, with or without a unit."""
    wanted = letters(place.port.name)
    return letters(column.name) == wanted or letters(read_header(column.name).bare) == wanted


def letters(name: str) -> str:
    """Return the letters and digits of a name, and the marks by which ``q*`` and ``q'`` are others than ``q``."""
    return "".join(c for c in name.casefold() if c.isalnum() or c in _MARKS)


def role_score(place: Place, column: Column) -> float:
    """Return how well role, quantity and unit agree; minus infinity where one forbids it."""
    never = -math.inf
    if column.apart and not set(tokens(place.port.name)) & {
        w for w in tokens(column.name) if ROLE_OF.get(w) == "error"
    }:
        return never
    if column.certain and place.dimension and column.dimension != place.dimension:
        return never
    if (place.commanded and column.measured and not column.commanded) or (not place.commanded and column.commanded):
        return never
    score, moves = 0.0, bool(place.dimensions & {"angle", "length", "angular rate", "speed"})
    if column.dimensions and place.dimensions:
        any_input = column.dimensions == EFFORT and INPUT in tokens(column.name)
        if not (column.dimensions & place.dimensions or (place.commanded and moves and any_input)):
            return never
        score += QUANTITY
    elif moves and not column.dimensions:  # by default a position rather than its derivative
        score += 0.2 * QUANTITY if place.dimensions & {"angle", "length"} else -0.2 * QUANTITY
    if place.commanded and column.commanded:
        score += ROLE
    elif place.commanded and (moves or column.dimensions) and not column.leads:
        score -= 0.5 * ROLE  # by default the reading rather than the command
    elif not place.commanded and (column.measured or column.leads):
        score += 0.5 * ROLE if column.measured else -0.5 * ROLE
    if column.unit and column.dimension == place.dimension != "":
        score += UNIT
    return score


class Names:
    """Likeness of names; a word counts less the more ports or columns share it."""

    def __init__(self, places: Sequence[Place], columns: Sequence[Column]) -> None:
        things = {p.words for p in places}
        self._n, self._of_ports = len(things), Counter(w for words in things for w in set(words))
        named = {c.words for c in columns}
        self._m, self._of_columns = len(named), Counter(w for words in named for w in set(words))
        bare = {tuple(w for w in words if not w.isdigit()) for words in things}
        self.numbered = len(bare) == 1 < len(things)
        """Whether ports differ in numbers alone."""

    def _weight(self, word: str, counts: Mapping[str, int], n: int) -> float:
        share = math.log((n + 1) / counts.get(word, 1)) if n else 0.0
        return 0.25 * share if ROLE_OF.get(word) == "filler" else share

    def score(self, place: Place, column: Column) -> float:
        """Return the likeness of two names, 0 to 1."""
        if not place.words or not column.words:
            return 0.0
        if "".join(place.words) == "".join(column.words):
            return 1.0
        mine, theirs, common, spoken = 0.0, 0.0, 0.0, self.numbered
        for word in set(place.words):
            weight = self._weight(word, self._of_ports, self._n)
            best = max((_alike(word, other) for other in column.words), default=0.0)
            mine += weight
            if not word.isdigit():
                common += weight * best
                spoken |= best > 0.0 and weight > 0.0 and ROLE_OF.get(word) != "filler"
        for word in set(column.words):
            theirs += self._weight(word, self._of_columns, self._m) if self._m > 1 else 0.5
        if spoken:  # numbers alone are no clue where ports have names
            common += sum(
                self._weight(w, self._of_ports, self._n) for w in set(place.words) if w.isdigit() and w in column.words
            )
        return min(common / math.sqrt(mine * max(theirs, 0.5 * mine)), 1.0) if mine > 0.0 else 0.0


def _alike(a: str, b: str) -> float:
    """Return how alike two words are: the same, the beginning of the other, or a letter or two apart."""
    if a == b:
        return 1.0
    if a.isdigit() or b.isdigit() or min(len(a), len(b)) < 2:
        return 0.0
    if min(len(a), len(b)) > 2 and (a.startswith(b) or b.startswith(a)):
        return 0.8
    near = difflib.SequenceMatcher(None, a, b).ratio()
    return 0.7 if near > 0.8 and min(len(a), len(b)) > 3 else 0.0

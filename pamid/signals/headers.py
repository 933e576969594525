"""What the header of a column says: words, unit, gauge or absolute."""

import re
from typing import NamedTuple

from .unit_names import unit_name
from .units import UNITS
from .vocabulary import WORDS

GAUGE = frozenset(("gauge", "gage", "rel", "relative", "relativ", "überdruck", "ueberdruck", "relativdruck"))
ABSOLUTE = frozenset(("abs", "absolute", "absolut", "absolutdruck"))
SIDES = {
    "1": 1, "2": 2, "a": 1, "b": 2, "left": 1, "right": 2, "agonist": 1, "antagonist": 2, "flexor": 1, "extensor": 2,
    "links": 1, "rechts": 2, "linker": 1, "rechter": 2, "l": 1, "r": 2,
}  # fmt: skip
"""Words that number the two muscles of a bench."""
_ASIDES = {
    *WORDS["treated"], *WORDS["wanted"], *"xyz", "in", "out", "cmd", "meas", "measured", "gemessen", "messwert", "ist",
    "istwert", "actual", "cal", "calibrated", "kalibriert", "sim", "simulated",
}  # fmt: skip
"""What parentheses hold beside units."""
_BRACKETS = re.compile(r"([\[({<])\s*([^\[\](){}<>]*(?:\([^()]*\))?)\s*[\])}>]")

WITH_D = r"(?!(?<=d)(?<![^\W_]d)[A-Z](?![A-Za-z]))"
"""Pattern of a place that is not within a letter and the d of its change, as in dV."""


class Header(NamedTuple):
    """What a header says."""

    words: list[str]
    """Its words in small letters, without unit."""
    unit: str | None = None
    """Unit that it states, as `pamid.signals.UNITS` names it."""
    unread: str = ""
    """An unknown word where a unit should stand; empty otherwise."""
    gauge: bool | None = None
    """True for gauge, False for absolute pressure, None where it says neither."""
    bracketed: bool = False
    """Whether the unit stands in brackets or behind a slash: it is then meant as one beyond doubt."""
    bare: str = ""
    """The name without its unit, letter by letter."""

    @property
    def clear(self) -> bool:
        """Whether its unit can be no other word or letter, as ``in`` and the ``m`` of a motor can."""
        unit = self.unit or ""
        return self.bracketed or not (unit in _ASIDES or (unit.isalpha() and len(unit) < 2))


def read_header(name: str) -> Header:
    """Read words, unit (in brackets, after a slash, comma or "in", or last) and reference from a column's name."""
    rest, unit, unread, asides = _out_of_brackets(name)
    bracketed = unit is not None or bool(unread)
    if not bracketed:
        rest, unit, unread = _behind_a_mark(rest)
        bracketed = unit is not None or bool(unread)
    tokens = _tokens(rest.strip().lstrip("%"))
    bare = rest.strip()
    if not bracketed:
        tokens, unit = _quotient(rest, tokens) or _last_word(tokens)
        bare = "_".join(tokens) if unit else bare
    words = [t.casefold() for t in [*tokens, *asides]]
    said = set(words)
    gauge = True if said & GAUGE else False if said & ABSOLUTE else None
    return Header(words, unit, unread, gauge, bracketed, bare)


def _out_of_brackets(name: str) -> tuple[str, str | None, str, list[str]]:
    """Return the rest of a name, the unit in its brackets, an invalid unit, and other words in brackets."""
    unit, unread, asides = None, "", []
    for mark, inside in _BRACKETS.findall(name):
        inside = inside.strip()
        words = [w.casefold() for w in _tokens(inside)]
        if (found := unit_name(inside)) is not None and not (inside.isdigit() and inside != "1"):
            if inside == "1" and mark == "(":
                asides.append(inside)
            elif unit is None:
                unit = found
        elif not words or all(w.isdigit() or w in GAUGE or w in ABSOLUTE or w in _ASIDES or w in SIDES for w in words):
            asides += words
        elif mark == "(" and (len(inside) > 8 or ("/" not in inside and len(words) > 1)):
            asides += words  # a remark rather than a unit
        elif any(c in inside for c in ":") and re.search(r"[hH]{1,2}:[mM]{1,2}", inside):
            continue  # how a time of day is written
        else:
            unread = unread or inside
    rest = _BRACKETS.sub(" ", name) if unit or unread or asides or _BRACKETS.search(name) else name
    return rest, unit, "" if unit else unread, asides


def _behind_a_mark(name: str) -> tuple[str, str | None, str]:
    """Return the part before a slash, a comma or "in", the unit after it, and an invalid unit."""
    for mark in re.finditer(r"\s+in\s+|[/,;:]", name):
        left, right = name[: mark.start()].strip(), name[mark.end() :].strip()
        whole = re.search(r"[\s_]+(\S[^\s_]*)$", left) if mark[0] == "/" else None
        if whole and (unit := unit_name(f"{whole[1]}/{right}")) is not None:  # m/s rather than s
            return left[: whole.start()], unit, ""
        composed = whole and whole[1].casefold() not in SIDES and unit_name(whole[1]) and unit_name(right)
        if whole and composed:  # W/m2, of no dimension in the table
            return left[: whole.start()], None, f"{whole[1]}/{right}"
        if left and right and (unit := unit_name(right)) is not None and not right.isdigit():
            return left, unit, ""
    slash = re.search(r"\s+/\s+(\S+)$", name)
    return (name[: slash.start()], None, slash[1]) if slash else (name, None, "")


def _tokens(text: str) -> list[str]:
    spaced = re.sub(rf"(?<=[a-zäöüß])(?=[A-Z]){WITH_D}|(?<=[A-Za-zäöü])(?=\d)", " ", text)
    return [w for w in re.split(r"[^\w°%µ]+|_", spaced) if w]


def _quotient(name: str, tokens: list[str]) -> tuple[list[str], str] | None:
    """Find a unit such as g/L or kg/m3 in the last two words of a name: its L is not "left", its 3 no number."""
    words = re.split(r"[\W_]+", name.strip())
    unit = unit_name("/".join(words[-2:])) if len(words) > 2 and all(words[-2:]) else None
    return (tokens[: -len(_tokens("_".join(words[-2:])))], unit) if unit else None


def _last_word(tokens: list[str]) -> tuple[list[str], str | None]:
    """Find a unit at the end of a name, before words for side, reference or treatment."""
    end = len(tokens)
    while end > 1 and _is_tail(tokens[end - 1]):
        end -= 1
    for count in (3, 2, 1):
        if end - count < 1:
            continue
        last = tokens[end - count : end]
        for joined in ("/".join(last), " ".join(last), "".join(last)):
            unit = joined if len(joined) == 1 and joined in UNITS else unit_name(joined) if len(joined) > 1 else None
            if unit is not None and unit not in ("-", "1"):
                return [*tokens[: end - count], *tokens[end:]], unit
    return tokens, None


def _is_tail(token: str) -> bool:
    word = token.casefold()
    known = word in SIDES or word.isdigit() or word in GAUGE or word in ABSOLUTE or word in _ASIDES
    return (known and unit_name(token) is None) or word.isdigit()

"""The candidates, those ruled out, and why."""

from typing import Any, ClassVar

from ..causes import cause_names, named
from ..drawings.ranking import answer_names
from ..quantities import cell
from ..ranked import certainty, closes, reason
from ..sentences import query_words
from ..words import Words
from .base import Section

_FIRST = 6


class WhichSection(Section):
    """The ranking of the whole library with ``none`` and ``unknown``."""

    name: ClassVar[str] = "which"
    title: ClassVar[str] = "Which effect causes it"
    rank: ClassVar[int] = 30

    def heading(self) -> str:
        """Return the heading under this diagnosis."""
        return self.title if self.diagnosis.gap else "What was tried"

    def shown(self) -> bool:
        """Whether candidates were ranked."""
        return bool(self.diagnosis.candidates)

    def content(self) -> dict[str, Any]:
        """Return the ranking."""
        d = self.diagnosis
        told = answer_names(d)
        rows = [
            {
                "name": _name(c.effect, c.where),
                "confidence": certainty(d, c),
                "text": cell(certainty(d, c)),
                "closes": closes(d, c),
                "why": "the answer" if (c.effect, c.where) in told else reason(d, c),
                "told": (c.effect, c.where) in told,
            }
            for c in sorted(d.candidates, key=lambda c: ((c.effect, c.where) not in told, -c.confidence))
        ]
        apart = [
            {"names": cause_names(cause, self.words), "by": cause.distinguished_by}
            for cause in d.causes
            if len(cause_names(cause, self.words)) > 1
        ]
        first = max(_FIRST, len(told) + 2)
        return {
            "first": rows[:first],
            "others": rows[first:],
            "apart": apart,
            "leftover": _leftover(d.leftover, self.words),
        }


def _name(name: str, where: str) -> str:
    known = {"none": "none (no gap)", "unknown": "unknown (not in the library)"}
    return known.get(name) or named(name, where)


def _leftover(found: dict[str, Any], words: Words) -> list[tuple[str, str]]:
    lines = []
    for key, value in found.items():
        if isinstance(value, (list, tuple)):
            text = ", ".join(str(v) for v in value)
        elif isinstance(value, float):
            text = cell(value) if "share" in key else f"{value:.3g}"
        elif key in ("query", "region"):
            text = query_words(str(value), words)
        else:
            text = str(value)
        if text:
            lines.append((key.replace("_", " "), text))
    return lines

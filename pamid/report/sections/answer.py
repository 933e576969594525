"""The answer in three sentences."""

from typing import Any, ClassVar

from ..sentences import answers
from .base import Section

_BADGES = {
    "cause": "one cause",
    "class": "one of a few causes",
    "several": "several causes",
    "unknown": "cause not in the library",
    "none": "no gap",
    "untested": "not tested",
}
_NOT_YET = "cause not found yet"


class AnswerSection(Section):
    """Where, which and how far, one sentence each, with the verdict."""

    name: ClassVar[str] = "answer"
    title: ClassVar[str] = ""
    rank: ClassVar[int] = 0

    def content(self) -> dict[str, Any]:
        """Return the sentences."""
        d = self.diagnosis
        told = answers(d)
        return {
            "badge": _NOT_YET if d.verdict == "unknown" and d.interrupted else _BADGES.get(d.verdict, d.verdict),
            "verdict": told.verdict,
            "kind": d.verdict if d.verdict in _BADGES else "unknown",
            "rows": [("Where", told.where), ("Which", told.which), ("How far", told.how_far)],
        }

"""Notes for the reader."""

from typing import Any, ClassVar

from .base import Section


class NotesSection(Section):
    """What the log lacks and what the noise floor rests on, and where the diagnosis comes from."""

    name: ClassVar[str] = "notes"
    title: ClassVar[str] = "What this rests on"
    rank: ClassVar[int] = 90

    def content(self) -> dict[str, Any]:
        """Return notes and source."""
        s = self.source
        facts = [
            ("log", s.log),
            ("simulator", s.simulator),
            ("rows", f"{s.rows:,}" if s.rows else ""),
            ("runs", str(s.runs) if s.runs else ""),
            ("command", s.command),
        ]
        return {"notes": self.diagnosis.notes, "facts": [(k, v) for k, v in facts if v]}

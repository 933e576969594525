"""How long the log is. Copy to ``pamid/report/sections/my_section.py`` and change template and content."""

from __future__ import annotations

from typing import Any, ClassVar

from .base import Section


class MySection(Section):
    """Rows and runs of the log, in a sentence."""

    name: ClassVar[str] = "my-section"
    title: ClassVar[str] = "The log"
    rank: ClassVar[int] = 95
    template: ClassVar[str] = "<p>{{ rows }} rows in {{ runs }} runs.</p>"

    def content(self) -> dict[str, Any]:
        """Return what the template reads."""
        return {"rows": self.source.rows, "runs": self.source.runs}

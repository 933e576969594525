"""Before and after each further log."""

from typing import Any, ClassVar

from ..drawings.rounds import rounds_figure
from ..quantities import amount, effect, listed, percent
from .base import Section


class RoundsSection(Section):
    """Confidences, intervals and remainder, round by round, as one picture and a table."""

    name: ClassVar[str] = "rounds"
    title: ClassVar[str] = "Before and after this log"
    rank: ClassVar[int] = 24

    def shown(self) -> bool:
        """Whether the diagnosis went on from an earlier one."""
        return len(self.diagnosis.rounds) > 1

    def content(self) -> dict[str, Any]:
        """Return the picture and a row a round."""
        d = self.diagnosis
        caption = (
            "Confidence of the likeliest effects, the first cause's main parameter with its 90 % interval, and the "
        )
        caption += "share of the gap that remains, over the recorded time."
        rows = []
        for k, r in enumerate(d.rounds, start=1):
            first = next(iter(r.confidences), "")
            rows.append(
                {
                    "round": k,
                    "logs": listed(r.logs),
                    "seconds": amount(r.seconds, "s"),
                    "verdict": r.verdict,
                    "first": effect(first) if first else "",
                    "confidence": percent(r.confidences.get(first, 0.0)),
                    "left": percent(r.left),
                }
            )
        return {"pictures": [self.picture(rounds_figure(d), "rounds", caption)], "rows": rows}

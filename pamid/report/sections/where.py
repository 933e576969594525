"""In which equations, regions, bands and runs the gap lies."""

import math
from typing import Any, ClassVar

from ..quantities import cell, probability
from ..sentences import region_words
from .base import Section

_RUNS = 6
_REGIONS = 4  # of one equation
_WORTH_A_LINE = 0.02


class WhereSection(Section):
    """The shares of the gap as tables with bars."""

    name: ClassVar[str] = "where"
    title: ClassVar[str] = "Where the gap lies"
    rank: ClassVar[int] = 10

    def heading(self) -> str:
        """Return the heading under this diagnosis."""
        return self.title if self.diagnosis.gap else "The equations"

    def shown(self) -> bool:
        """Whether any equation was tested."""
        return bool(self.diagnosis.equations)

    def content(self) -> dict[str, Any]:
        """Return the tables."""
        d = self.diagnosis
        gap = d.gap
        equations = [
            {
                "name": self.words.equation(e.equation),
                "share": e.share if gap else math.nan,
                "text": cell(e.share) if gap else "",
                "excess": f"{float(f'{e.excess:.2g}'):g}" if math.isfinite(e.excess) else "",
                "p": probability(e.p_value),
            }
            for e in sorted(d.equations, key=lambda e: -e.share)
        ]
        regions = [
            {
                "equation": self.words.equation(r.equation),
                "words": region_words(r.query, self.words),
                "query": r.query,
                "share": r.share,
                "text": cell(r.share),
                "samples": cell(r.samples),
            }
            for r in d.regions
        ]
        names = [r.equation for r in d.regions]
        few = [r.share >= _WORTH_A_LINE and names[:k].count(r.equation) < _REGIONS for k, r in enumerate(d.regions)]
        shown = [row for row, wanted in zip(regions, few, strict=True) if wanted]
        runs = sorted(d.trajectories, key=lambda t: -t.share)
        rows = [{"name": t.trajectory, "share": t.share, "text": cell(t.share)} for t in runs]
        return {
            "gap": gap,
            "equations": equations,
            "regions": shown if gap else [],
            "other_regions": len(regions) - len(shown) if gap else 0,
            "runs": rows[:_RUNS] if gap else [],
            "other_runs": len(rows) - _RUNS if gap else 0,
        }

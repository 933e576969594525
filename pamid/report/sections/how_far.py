"""How far the gap shrinks."""

from typing import Any, ClassVar

from ..drawings.closure import closure_figure
from ..quantities import error_size, percent_within, share_span
from .base import Picture, Section


class HowFarSection(Section):
    """Closure as a waterfall and a table of all equations."""

    name: ClassVar[str] = "how-far"
    title: ClassVar[str] = "How far the gap shrinks"
    rank: ClassVar[int] = 60

    def heading(self) -> str:
        """Return the heading under this diagnosis."""
        return self.title if self.diagnosis.added else "The errors and their noise"

    def shown(self) -> bool:
        """Whether closure was tested."""
        return bool(self.diagnosis.closure)

    def content(self) -> dict[str, Any]:
        """Return waterfalls and the table."""
        d = self.diagnosis
        rows = [
            {
                "equation": self.words.equation(c.equation),
                "before": error_size(c.rmse_before, c.unit),
                "after": error_size(c.rmse_after, c.unit),
                "noise": error_size(c.noise_floor, c.unit),
                "closed": percent_within(c.closed_share, *c.ci90) if d.added else "",
                "ci": share_span(*c.ci90) if d.added else "",
            }
            for c in d.closure
        ]
        told = list(dict.fromkeys(c.equation for c in d.added))
        with_gap = [c.equation for c in d.closure if c.equation in told][:2] if d.added else []
        pictures: list[Picture] = [
            self.picture(
                closure_figure(d, name),
                name,
                f"The mean square {self.words.residual_words(name)} on unseen runs: before, the part that each cause "
                "removes, after, and how much of that is noise.",
            )
            for name in with_gap
        ]
        return {"rows": rows, "pictures": pictures, "gap": d.gap, "added": bool(d.added)}

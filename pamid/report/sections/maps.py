"""The residual over the state."""

from typing import Any, ClassVar

from ..drawings.maps import axes_of, bounds, map_figure
from ..drawings.windows import equations
from ..sentences import leading_region, region_words
from .base import Picture, Section

_WORTH = 0.1  # share of the gap from which an equation beside the first one is mapped


class MapsSection(Section):
    """Maps of the mean residual over pairs of signals, before and after."""

    name: ClassVar[str] = "maps"
    title: ClassVar[str] = "The error over the state"
    rank: ClassVar[int] = 20

    def shown(self) -> bool:
        """Whether some equation has windows that vary."""
        return any(axes_of(self.diagnosis, e) for e in equations(self.diagnosis)[:1])

    def content(self) -> dict[str, Any]:
        """Return the maps."""
        d = self.diagnosis
        share = {e.equation: e.share for e in d.equations}
        names = equations(d)
        told = [n for n in names if n == names[0] or (d.gap and share.get(n, 0.0) >= _WORTH)][:2]
        pictures: list[Picture] = []
        for name in told:
            for x, y in axes_of(d, name):
                words = f"{self.words.residual_words(name)} over {self._words(x)} and {self._words(y)}"
                region = leading_region(d.regions, name)
                framed = d.gap and region is not None and bool({x, y} & set(bounds(region.query)))
                caption = f"Mean {words}" + (
                    f". Framed: {region_words(region.query, self.words)}" if framed and region is not None else ""
                )
                pictures.append(self.picture(map_figure(d, name, x, y), f"{name}-{x}-{y}", f"{caption}."))
        return {"pictures": pictures, "added": bool(d.added)}

    def _words(self, name: str) -> str:
        return self.words.signal(name).words.removesuffix(", absolute")

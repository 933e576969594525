"""Runs before and after."""

from typing import Any, ClassVar

from ..drawings.loops import loop_figure, shared_scale
from ..drawings.windows import equations, main_equation, telling_trajectories
from ..quantities import capital, run_named
from .base import Section


class LoopsSection(Section):
    """The residual of the most telling runs as loops and over time."""

    name: ClassVar[str] = "loops"
    title: ClassVar[str] = "The error in single runs"
    rank: ClassVar[int] = 40

    def shown(self) -> bool:
        """Whether there are windows."""
        return bool(equations(self.diagnosis))

    def content(self) -> dict[str, Any]:
        """Return the pictures."""
        d = self.diagnosis
        name = main_equation(d)
        pictures = []
        runs = telling_trajectories(d, name, 3 if d.gap else 2)
        limits = shared_scale(d, name, runs)
        for place, trajectory in enumerate(runs):
            words = self.words.residual_words(name)
            caption = f"{capital(words)} in {run_named(trajectory)}."
            pictures.append(self.picture(loop_figure(d, name, trajectory, limits), str(place), caption))
        return {"pictures": pictures, "added": bool(d.added)}

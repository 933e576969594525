"""Measured against simulated."""

from typing import Any, ClassVar

from ..drawings.course import course_figure, fit, fit_words, shared_limits
from ..drawings.readings import readings_figure
from ..drawings.windows import equations, main_equation, of_equation, states, telling_trajectories
from ..quantities import capital, run_named
from .base import Section


class CourseSection(Section):
    """What was measured and what the simulator says, in the most telling runs, on one scale."""

    name: ClassVar[str] = "course"
    title: ClassVar[str] = "Measured and simulated"
    rank: ClassVar[int] = 15

    def shown(self) -> bool:
        """Whether there are windows with measurements."""
        return bool(equations(self.diagnosis)) and "measured" in self.diagnosis.windows

    def content(self) -> dict[str, Any]:
        """Return the pictures and the fits."""
        d = self.diagnosis
        name = main_equation(d)
        runs = telling_trajectories(d, name, 2)
        limits = shared_limits(d, name, runs)
        pictures, readings = [], []
        for k, run in enumerate(runs):
            words = self.words.equation(name)
            words = words if self.words.is_at_ports(words) else capital(words)  # no port's own name
            caption = f"{words} in {run_named(run)}."
            pictures.append(self.picture(course_figure(d, name, run, limits), str(k), caption))
            if (figure := readings_figure(d, run, name)) is not None:
                caption = f"Every row of the log in {run_named(run)}."
                readings.append(self.picture(figure, f"readings-{k}", caption))
        rows = []
        for one in equations(d):
            part = of_equation(d, one)
            rows.append(
                {"equation": self.words.equation(one), "fits": [fit_words(fit(part, state)) for state in states(d)]}
            )
        return {"pictures": pictures, "readings": readings, "rows": rows, "added": bool(d.added)}

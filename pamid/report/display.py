"""A diagnosis in a notebook: its sentences and pictures."""

from collections.abc import Callable
from html import escape
from typing import Any, Self

from matplotlib.figure import Figure

from ..errors import ParameterError, UnknownOptionError
from ..gap.diagnosis.result import Diagnosis
from .sentences import answers

KINDS = ("map", "course", "loop", "ranking", "spectrum", "closure")
"""What can be drawn."""


class GapDisplay:
    """Pictures of a diagnosis, one per call.

    In a notebook it shows what was drawn last; before that, the answer in words.

    Parameters
    ----------
    diagnosis : Diagnosis
        What `pamid.gap.diagnose` returned.

    Attributes
    ----------
    figure_ : Figure
        What was drawn last.
    axes_ : list of Axes
        Its axes.
    kind_ : str
        What it shows.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> nominal = BenchParameters.for_muscle("B")
    >>> log = simulate(nominal, [sine(2, 10, 500), sine(6, 10, 500)], effects=["leakage"])
    >>> from pamid.report import GapDisplay
    >>> display = GapDisplay.from_diagnosis(diagnose(log, nominal, ["leakage"]))
    >>> display.plot("ranking").axes_[0].get_xlabel()
    'confidence / %'
    """

    def __init__(self, diagnosis: Diagnosis) -> None:
        self.diagnosis = diagnosis

    @classmethod
    def from_diagnosis(cls, diagnosis: Diagnosis) -> Self:
        """Return the display of a diagnosis, to be drawn with ``plot``."""
        return cls(diagnosis)

    @classmethod
    def from_estimator(cls, estimator: Any) -> Self:
        """Return the display of what a fitted estimator found, its ``diagnosis_``; raise a `ParameterError` without
        one.
        """
        diagnosis = getattr(estimator, "diagnosis_", None)
        if diagnosis is None:
            raise ParameterError(
                f"{type(estimator).__name__} holds no diagnosis.",
                "a fitted estimator with the attribute diagnosis_",
                "Fit it first, or use GapDisplay.from_diagnosis.",
            )
        return cls(diagnosis)

    def plot(self, kind: str = "map", *, equation: str | None = None, **options: Any) -> Self:
        """Draw one picture in a new figure.

        Parameters
        ----------
        kind : {"map", "course", "loop", "ranking", "spectrum", "closure"}, default="map"
            The residual over the state, measured and simulated over the time of one run, the residual as loops of one
            run, the candidates, the residual by frequency, or how far it shrinks.
        equation : str, optional
            Of which equation; the one with most of the gap by default.
        **options
            ``x`` and ``y`` (signals) of a map, ``trajectory`` of a course or loop, ``most`` of a ranking.

        Returns
        -------
        GapDisplay
            With the attributes ``figure_`` and ``axes_``.

        Raises
        ------
        UnknownOptionError
            If there is no such kind, equation or run.
        """
        if kind not in KINDS:
            raise UnknownOptionError(f"There is no picture {kind!r}.", f"one of {', '.join(KINDS)}", "Correct it.")
        self.kind_ = kind
        self.figure_ = _drawn(self.diagnosis, kind, equation, options)
        self.axes_ = list(self.figure_.axes)
        return self

    def _repr_html_(self) -> str:
        if hasattr(self, "figure_"):
            from .svg import inline_svg

            svg = inline_svg(self.figure_, f"gap-{id(self.figure_):x}", self.kind_)
            return svg.replace("<svg ", '<svg style="max-width: 560px" ', 1)
        told = answers(self.diagnosis)
        lines = "".join(
            f"<dt><strong>{word}</strong></dt><dd>{escape(text)}</dd>"
            for word, text in (("Where", told.where), ("Which", told.which), ("How far", told.how_far))
        )
        return f"<div><p><strong>{escape(told.verdict)}</strong></p><dl>{lines}</dl></div>"

    def __repr__(self) -> str:
        told = answers(self.diagnosis)
        return "\n".join([told.verdict, f"where: {told.where}", f"which: {told.which}", f"how far: {told.how_far}"])


def _drawn(d: Diagnosis, kind: str, equation: str | None, options: dict[str, Any]) -> Figure:
    from .drawings.closure import closure_figure
    from .drawings.course import course_figure
    from .drawings.loops import loop_figure
    from .drawings.maps import map_figure
    from .drawings.ranking import ranking_figure
    from .drawings.spectrum import spectrum_figure

    if kind == "ranking":
        return ranking_figure(d, **options)
    draw: dict[str, Callable[..., Figure]] = {
        "map": map_figure,
        "course": course_figure,
        "loop": loop_figure,
        "spectrum": spectrum_figure,
        "closure": closure_figure,
    }
    return draw[kind](d, equation, **options)

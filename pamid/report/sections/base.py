"""What a section of the page is."""

from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar, NamedTuple

from matplotlib.figure import Figure

from ...explained import explained_fields
from ...gap.diagnosis.result import Diagnosis
from ..words import Words


@explained_fields
class Source(NamedTuple):
    """Where a diagnosis comes from.

    Examples
    --------
    >>> from pamid.report.sections.base import Source
    >>> Source(log="bench.parquet", simulator="sim.toml", rows=20_000, runs=10).rows
    20000
    """

    log: Annotated[str, "Name of the log."] = ""
    simulator: Annotated[str, "Name of the simulator file."] = ""
    rows: Annotated[int, "Rows of the log."] = 0
    runs: Annotated[int, "Its runs."] = 0
    command: Annotated[str, "The command that made it."] = ""


@explained_fields
class Picture(NamedTuple):
    """A figure on the page.

    Examples
    --------
    >>> from pamid.report.sections.base import Picture
    >>> Picture("<svg></svg>", "Residual over contraction and its rate").caption
    'Residual over contraction and its rate'
    """

    svg: Annotated[Any, "The ``svg`` element."]
    caption: Annotated[str, "What to see in it; plain text."]


class Section(ABC):
    """One section of the page: a template of its name, and what it needs. A module of this package adds one by itself.

    Parameters
    ----------
    diagnosis : Diagnosis
        What is told.
    source : Source
        Where it comes from.

    Examples
    --------
    >>> from pamid.report.sections import all_sections
    >>> first = all_sections()[0]
    >>> first.name, first.title
    ('answer', '')
    """

    name: ClassVar[str]
    """Name of its template and its anchor."""
    title: ClassVar[str]
    """Heading; empty for none."""
    rank: ClassVar[int]
    """Place on the page."""
    template: ClassVar[str] = ""
    """Text of its template (jinja2); by default the file of its name in ``pamid/report/templates``."""

    def __init__(self, diagnosis: Diagnosis, source: Source) -> None:
        self.diagnosis, self.source = diagnosis, source
        self.words = Words.of(diagnosis)

    def shown(self) -> bool:
        """Whether the diagnosis has something for it."""
        return True

    def heading(self) -> str:
        """Return the heading under this diagnosis."""
        return self.title

    @abstractmethod
    def content(self) -> dict[str, Any]:
        """Return the variables of its template."""

    def picture(self, figure: Figure, name: str, caption: str) -> Picture:
        """Return a figure for the page."""
        from markupsafe import Markup

        from ..svg import inline_svg

        return Picture(Markup(inline_svg(figure, f"{self.name}-{name}", caption)), caption)

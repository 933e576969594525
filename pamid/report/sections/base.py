"""What a section of the page is."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

from matplotlib.figure import Figure

from ...gap.diagnosis.result import Diagnosis
from ..words import Words


class Source(NamedTuple):
    """Where a diagnosis comes from.

    Parameters
    ----------
    log : str, default=""
        Name of the log.
    simulator : str, default=""
        Name of the simulator file.
    rows : int, default=0
        Rows of the log.
    runs : int, default=0
        Its runs.
    command : str, default=""
        The command that made it.

    Examples
    --------
    >>> from pamid.report.sections.base import Source
    >>> Source(log="bench.parquet", simulator="sim.toml", rows=20_000, runs=10).rows
    20000
    """

    log: str = ""
    simulator: str = ""
    rows: int = 0
    runs: int = 0
    command: str = ""


class Picture(NamedTuple):
    """A figure on the page.

    Parameters
    ----------
    svg : Markup
        The ``svg`` element.
    caption : str
        What to see in it; plain text.

    Examples
    --------
    >>> from pamid.report.sections.base import Picture
    >>> Picture("<svg></svg>", "Residual over contraction and its rate").caption
    'Residual over contraction and its rate'
    """

    svg: Any
    caption: str


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

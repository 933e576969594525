"""The page: one file that opens anywhere, without a network."""

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from ..explained import explained_by
from ..files import write_whole
from ..gap.diagnosis.result import Diagnosis
from .quantities import typeset
from .sections import Section, Source, all_sections

_TEMPLATES = Path(__file__).parent / "templates"
_UNIT = re.compile(r"(?<=\d) (?=%|(?:N|mg|Hz|bar|Pa|deg|rad|kg|K|m|s)\b)")


def report_html(
    diagnosis: Diagnosis, source: Source | None = None, progress: Callable[[str], None] | None = None
) -> str:
    """Return a diagnosis as a page.

    Parameters
    ----------
    diagnosis : Diagnosis
        What `pamid.gap.diagnose` returned.
    source : Source, optional
        Where it comes from: names of log and simulator, rows, runs.
    progress : callable, optional
        Called with the name of each section once it is drawn; its ``expect``, if it has one, gets their number.

    Returns
    -------
    str
        Self-contained HTML with its pictures and its style. All text is escaped.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> nominal = BenchParameters.for_muscle("B")
    >>> log = simulate(nominal, [sine(2, 10, 500), sine(6, 10, 500)], effects=["leakage"])
    >>> from pamid.report import report_html
    >>> report_html(diagnose(log, nominal, ["leakage"])).startswith("<!")
    True
    """
    from markupsafe import Markup

    source = source or Source()
    templates = environment()
    sections = [cls(diagnosis, source) for cls in all_sections()]
    parts: list[dict[str, Any]] = []
    shown = [s for s in sections if s.shown()]
    if (expect := getattr(progress, "expect", None)) is not None:
        expect(len(shown))
    for s in shown:
        body = Markup(_template(templates, s).render(s.content()))
        parts.append({"name": s.name, "title": s.heading(), "body": body})
        if progress is not None:
            progress(s.name)
    style = Markup((_TEMPLATES / "page.css").read_text(encoding="utf-8"))
    return templates.get_template("page.html").render(sections=parts, source=source, style=style)


@explained_by(report_html)
def write_report(diagnosis: Diagnosis, path: str | Path, source: Source | None = None) -> Path:
    """Write a diagnosis as a page, whole or not at all.

    Parameters
    ----------
    path : path-like
        The file; one that exists is replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.gap import diagnose
    >>> nominal = BenchParameters.for_muscle("B")
    >>> log = simulate(nominal, [sine(2, 10, 500), sine(6, 10, 500)], effects=["leakage"])
    >>> import tempfile
    >>> from pathlib import Path
    >>> from pamid.report import write_report
    >>> found = diagnose(log, nominal, ["leakage"])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     page = write_report(found, Path(folder) / "report.html")
    ...     print(page.name, page.stat().st_size > 10_000)
    report.html True
    """
    return write_whole(path, report_html(diagnosis, source))


@cache
def environment(templates: Path = _TEMPLATES) -> Environment:
    """Return the templates of a folder, which escape all text."""
    made = Environment(
        loader=FileSystemLoader(templates),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["typeset"] = lambda text: typeset(_UNIT.sub("\u00a0", text))  # numbers stay with their units
    made.filters["bar"] = _bar
    return made


def _bar(share: Any) -> str:
    """Return the width of a bar in per cent of its place."""
    try:
        value = float(share)
    except (TypeError, ValueError):
        return "0"
    return f"{100 * min(max(value, 0.0), 1.0):.1f}" if value == value else "0"


def _template(templates: Any, section: Section) -> Any:
    if section.template:
        return templates.from_string(section.template)
    return templates.get_template(f"{section.name}.html")

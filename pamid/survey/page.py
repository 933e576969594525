"""A survey as one page that opens anywhere, without a network."""

from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from .survey import Survey
from .words import channel_rows, sampling_sentence

_TEMPLATES = Path(__file__).parent / "templates"
_BADGE = {"yes": "none", "partly": "class", "no": "unknown"}


def survey_html(found: Survey, log: pd.DataFrame, name: str = "") -> str:
    """Return a survey as a self-contained HTML page, with pictures of the log; all text is escaped."""
    from markupsafe import Markup

    from ..report import page as report

    if "trajectory" not in log.columns:
        log = log.assign(trajectory="0")
    header, rows = channel_rows(found.channels)
    css = (Path(report.__file__).parent / "templates" / "page.css").read_text(encoding="utf-8")
    answers = [(a, _BADGE[a.answer]) for a in found.answers]
    return (
        report.environment(_TEMPLATES)
        .get_template("check.html")
        .render(
            name=name or "Log",
            style=Markup(css),
            found=found,
            sampling=sampling_sentence(found.sampling),
            header=header,
            rows=rows,
            answers=answers,
            verdict=_verdict(found),
            seen=[s for s in found.separations if s.seen],
            hidden=[s for s in found.separations if not s.seen],
            classes=found.classes(),
            pictures=_pictures(found, log),
        )
    )


def _verdict(found: Survey) -> str:
    """Return in one sentence how much the log can tell."""
    good = sum(a.answer == "yes" for a in found.answers)
    partly = sum(a.answer == "partly" for a in found.answers)
    faults = len(found.warnings)
    said = f"{good} of {len(found.answers)} questions can be answered from this log"
    said += f", {partly} in part" if partly else ""
    return said + (f"; {faults} warning{'' if faults == 1 else 's'}." if faults else "; no warnings.")


def _pictures(found: Survey, log: pd.DataFrame) -> list[dict[str, Any]]:
    from markupsafe import Markup

    from ..report.svg import inline_svg
    from .pictures import coverage_picture, run_picture, speed_picture

    drawn: list[tuple[str, Figure | None, str]] = [
        ("run", run_picture(log, found.coverage), "The longest run."),
        (
            "coverage",
            coverage_picture(log, found.coverage),
            "What the log covers: a thin line here distinguishes little.",
        ),
        ("speed", speed_picture(log, found.coverage), "How long it moves at which speed; orange is the return stroke."),
    ]
    return [
        {"svg": Markup(inline_svg(figure, f"check-{key}", words)), "caption": words}
        for key, figure, words in drawn
        if figure is not None
    ]

"""A survey as one page with pictures that opens anywhere, without a network."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..plots.curves import drawn
from ..plots.style import BLUE, GREY, ORANGE, new_figure, style
from ..report.words import BENCH
from ..signals.thinning import spaced
from .coverage import Coverage, smoothed
from .survey import Survey
from .words import channel_rows, sampling_sentence

_TEMPLATES = Path(__file__).parent / "templates"
_BADGE = {"yes": "none", "partly": "class", "no": "unknown"}
_MOST_POINTS = 4000


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

    c = found.coverage
    pictures: list[tuple[str, Figure | None, str]] = [
        ("run", _run_picture(log, c), "The longest run."),
        ("coverage", _coverage_picture(log, c), "What the log covers: a thin line here distinguishes little."),
        ("speed", _speed_picture(log, c), "How long it moves at which speed; orange is the return stroke."),
    ]
    return [
        {"svg": Markup(inline_svg(figure, f"check-{key}", words)), "caption": words}
        for key, figure, words in pictures
        if figure is not None
    ]


def _coverage_picture(log: pd.DataFrame, c: Coverage) -> Figure:
    """Draw pressure (or the target) against position, one colour a direction of time's order."""
    across = c.position or "time"
    up = c.pressure or c.target or next(str(n) for n in log.columns if n not in ("trajectory", "time"))
    part = log[[across, up]].dropna().iloc[spaced(len(log), _MOST_POINTS)]
    x, y = BENCH.signal(across), BENCH.signal(up)
    with style():
        figure, axes = new_figure(4.6, 3.2)
        ax = axes[0, 0]
        ax.plot(part[across] * x.factor, part[up] * y.factor, ".", markersize=1.5, color=BLUE, alpha=0.5)
        ax.set(xlabel=x.label, ylabel=y.label)
    return figure


def _run_picture(log: pd.DataFrame, c: Coverage) -> Figure:
    """Draw the longest run over time: the moving and the measured signals."""
    sizes = log.groupby("trajectory", sort=False).size()
    run = log[log["trajectory"] == sizes.idxmax()]
    names = [n for n in dict.fromkeys((c.position, c.pressure, c.target)) if n] or [str(log.columns[-1])]
    time = (run["time"] - run["time"].iloc[0]).to_numpy(dtype=float)
    with style():
        figure, axes = new_figure(4.6, 0.8 + 1.1 * len(names), len(names), 1, sharex=True)
        for ax, name in zip(axes[:, 0], names, strict=True):
            q = BENCH.signal(name)
            ax.plot(*drawn(time, q.factor * run[name].to_numpy(dtype=float)), color=BLUE, linewidth=0.9)
            ax.set_ylabel(f"{name} / {q.unit}" if q.unit else name)
        axes[-1, 0].set_xlabel("time / s")
    return figure


def _speed_picture(log: pd.DataFrame, c: Coverage) -> Figure | None:
    """Draw how often which speed occurs, both ways; None where nothing moves."""
    if not c.position or not c.fast > 0:
        return None
    rates = [one.rate for one in smoothed(log, c.position)]
    if not rates:
        return None
    q = BENCH.signal(c.position)
    rate = np.concatenate(rates) * q.factor
    edge = float(np.quantile(np.abs(rate), 0.995))
    bins = np.linspace(-edge, edge, 41)
    with style():
        figure, axes = new_figure(4.6, 2.6)
        ax = axes[0, 0]
        share, _ = np.histogram(np.clip(rate, -edge, edge), bins=bins)
        colours = [ORANGE if b < 0 else BLUE for b in 0.5 * (bins[1:] + bins[:-1])]
        ax.bar(0.5 * (bins[1:] + bins[:-1]), 100 * share / len(rate), width=np.diff(bins), color=colours)
        ax.axvline(0.0, color=GREY, linewidth=0.7)
        ax.set(
            xlabel=f"rate of {q.words.replace(', absolute', '')} / {f'{q.unit}/s' if q.unit else '1/s'}",
            ylabel="share of the time / %",
        )
    return figure

"""How far the gap shrinks, as a waterfall of the mean square error."""

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ...errors import UnknownOptionError
from ...gap.diagnosis.findings import Closure
from ...gap.diagnosis.result import Diagnosis
from ...plots.style import BLUE, FAINT, GREY, INK, ORANGE, SKY, new_figure, style
from ..causes import either
from ..quantities import typeset
from ..words import Words

_WORDS = 26  # letters of a label that fit beside the bars


class Bar(NamedTuple):
    """One bar of a waterfall."""

    label: str
    """What it stands for."""
    start: float
    end: float
    """From where to where, as shares of the mean square error before."""
    colour: str
    """Its colour."""
    text: str
    """What stands at its end."""


def closure_figure(d: Diagnosis, equation: str | None = None) -> Figure:
    """Draw how the mean square error of an equation, in which shares add up, falls as the causes are added."""
    closure = chosen_closure(d, equation)
    quantity = Words.of(d).residual(closure.equation, closure.unit)
    bars = waterfall(d, closure)
    with style():
        figure, axes = new_figure(5.2, 0.75 + 0.3 * len(bars))
        ax = axes[0, 0]
        for place, bar in enumerate(bars):
            left, width = min(bar.start, bar.end), abs(bar.end - bar.start)
            ax.barh(place, 100 * width, left=100 * left, color=bar.colour, height=0.62)
            if bar.colour in (ORANGE, BLUE) and place + 1 < len(bars):
                ax.plot([100 * bar.end] * 2, [place, place + 1], color=GREY, linewidth=0.6)
            inside = left + width > 0.7
            ax.annotate(
                bar.text,
                (100 * (left if inside and left > 0.3 else left + width), place),
                xytext=(-3 if inside else 3, 0),
                textcoords="offset points",
                ha="right" if inside else "left",
                va="center",
                fontsize=8,
                color="white" if inside and left <= 0.3 and bar.colour in (ORANGE, BLUE) else INK,
            )
        ax.set_yticks(range(len(bars)), [_short(b.label) for b in bars])
        ax.tick_params(axis="y", length=0)
        ax.set_ylim(len(bars) - 0.5, -0.5)
        ax.set_xlim(0, 102)
        ax.set_xlabel(f"mean square of the {quantity.words} / % of before")
    return figure


def chosen_closure(d: Diagnosis, equation: str | None) -> Closure:
    """Return the closure of an equation."""
    wanted = equation or (d.added[0].equation if d.added else None)
    by_name = {c.equation: c for c in d.closure}
    if wanted in by_name:
        return by_name[wanted]
    if equation is None and d.closure:
        return d.closure[0]
    raise UnknownOptionError(
        f"The diagnosis does not say how far {equation or 'a gap'} closes.",
        f"one of {', '.join(by_name)}" if by_name else "a closure",
        "Correct the name." if by_name else "Diagnose a log with more runs.",
    )


def waterfall(d: Diagnosis, closure: Closure) -> list[Bar]:
    """Return the bars of one equation: before, each cause's reduction, and the remainder: unexplained and noise."""
    quantity = Words.of(d).residual(closure.equation, closure.unit)

    def shown(value: float) -> str:
        return typeset(f"{quantity.factor * value:.3g} {quantity.unit}")

    before = closure.rmse_before**2
    if before <= 0:
        return [Bar("before", 0.0, 0.0, ORANGE, shown(0.0))]
    after, noise = closure.rmse_after**2 / before, min(closure.noise_floor**2 / before, 1.0)
    bars = [Bar("before", 0.0, 1.0, ORANGE, shown(closure.rmse_before))]
    own = [c for c in d.added if c.equation == closure.equation] or d.added
    taken = max(1.0 - after, 0.0)
    weights = np.array([max(c.share, 0.0) for c in own])
    parts = taken * (weights / weights.sum() if weights.sum() > 0 else np.full(len(own), 1.0 / max(len(own), 1)))
    level = 1.0
    for cause, part in zip(own, parts, strict=True):
        bars.append(Bar(f"− {either(cause, Words.of(d))}", level, level - part, BLUE, f"−{100 * part:.0f} %"))
        level -= part
    bars.append(Bar("after", 0.0, after, SKY, shown(closure.rmse_after)))
    if after > noise:
        left = float(np.sqrt(max(closure.rmse_after**2 - closure.noise_floor**2, 0.0)))
        bars.append(Bar("of which unexplained", after, noise, GREY, shown(left)))
    bars.append(Bar("of which noise", 0.0, noise, FAINT, shown(closure.noise_floor)))
    return bars


def _short(text: str) -> str:
    if len(text) <= _WORDS:
        return text
    cut = text[:_WORDS].rfind(" ")
    cut = cut if cut > 4 else _WORDS
    rest = text[cut:].strip()
    return f"{text[:cut]}\n{rest if len(rest) <= _WORDS else rest[: _WORDS - 1] + '…'}"

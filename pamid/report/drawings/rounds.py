"""A diagnosis before and after each further log: confidences, the main parameter, and the remaining gap."""

import numpy as np
from matplotlib.figure import Figure

from ...gap.diagnosis.result import Diagnosis
from ...plots.style import BLUE, FAINT, GREY, ORANGE, SKY, new_figure, style
from ..quantities import effect, parameter

_MOST = 4
"""Effects whose confidence is drawn."""


def rounds_figure(d: Diagnosis) -> Figure:
    """Draw confidences, the interval of the first cause's main parameter and the remainder, round by round."""
    rounds = d.rounds
    seconds = np.array([r.seconds for r in rounds])
    last = rounds[-1].confidences
    tops = {name: max(r.confidences.get(name, 0.0) for r in rounds) for r in rounds for name in r.confidences}
    shown = sorted(tops, key=lambda n: (-last.get(n, 0.0), -tops[n]))[:_MOST]
    shown = [name for name in shown if tops[name] > 0.02]
    with style():
        figure, axes = new_figure(7.4, 2.6, 1, 3)
        belief, interval, left = axes[0]
        for name, colour in zip(shown, (BLUE, ORANGE, SKY, GREY), strict=False):
            y = [100.0 * r.confidences.get(name, 0.0) for r in rounds]
            belief.plot(seconds, y, "o-", color=colour, label=effect(name))
        belief.set(xlabel="time recorded / s", ylabel="confidence / %", ylim=(-4.0, 104.0))
        belief.legend(fontsize=7, frameon=False)
        _interval(d, seconds, interval)
        left.plot(seconds, [100.0 * r.left for r in rounds], "o-", color=GREY)
        left.set(xlabel="time recorded / s", ylabel="remaining gap / %", ylim=(-4.0, 104.0))
    return figure


def _interval(d: Diagnosis, seconds: np.ndarray, ax: object) -> None:
    """Draw the main parameter of the first cause where a round names it."""
    name = d.causes[0].effects[0] if d.causes else next(iter(d.rounds[-1].parameters), None)
    rows = [(t, r.parameters[name]) for t, r in zip(seconds, d.rounds, strict=True) if name in r.parameters]
    ax.set(xlabel="time recorded / s")  # type: ignore[attr-defined]
    if not rows or name is None:
        ax.set(yticks=[], ylabel="no cause is named")  # type: ignore[attr-defined]
        return
    for t, p in rows:
        if p["low"] is not None and p["high"] is not None:
            ax.plot([t, t], [p["low"], p["high"]], color=FAINT, linewidth=5, solid_capstyle="butt")  # type: ignore[attr-defined]
    ax.plot([t for t, _ in rows], [p["value"] for _, p in rows], "o-", color=BLUE)  # type: ignore[attr-defined]
    unit = rows[-1][1]["unit"]
    words = parameter(rows[-1][1]["parameter"])
    ax.set(ylabel=f"{words} / {unit}" if unit != "-" else words)  # type: ignore[attr-defined]

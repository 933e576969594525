"""The candidates by their confidence."""

from matplotlib.figure import Figure

from ...gap.diagnosis.result import Diagnosis
from ...plots.style import BLUE, FAINT, GREY, new_figure, style
from ..causes import named
from ..quantities import places
from ..ranked import certainty


def ranking_figure(d: Diagnosis, most: int = 10) -> Figure:
    """Draw the confidence in each of the likeliest candidates."""
    candidates = sorted(d.candidates, key=lambda c: -certainty(d, c))[:most]
    told = answer_names(d)
    with style():
        figure, axes = new_figure(4.3, 0.7 + 0.24 * max(len(candidates), 1))
        ax = axes[0, 0]
        for place, candidate in enumerate(candidates):
            colour = BLUE if (candidate.effect, candidate.where) in told else GREY
            ax.barh(place, 100 * certainty(d, candidate), color=colour, height=0.62)
            ax.annotate(
                f"{100 * certainty(d, candidate):.0f}",
                (100 * certainty(d, candidate), place),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
            )
        ax.set_yticks(range(len(candidates)), [named(c.effect, c.where) for c in candidates])
        ax.tick_params(axis="y", length=0)
        ax.set_ylim(max(len(candidates), 1) - 0.4, -0.6)
        ax.set_xlim(0, 110)
        ax.axvline(100, color=FAINT, linewidth=0.7, zorder=0)
        ax.set_xlabel("confidence / %")
    return figure


def answer_names(d: Diagnosis) -> set[tuple[str, str]]:
    """Return the candidates that the verdict names, with the ports at which they act."""
    if d.verdict in ("none", "unknown"):
        return {(d.verdict, "")}
    return {place for cause in d.causes for place in zip(cause.effects, places(cause), strict=True)}

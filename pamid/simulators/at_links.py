"""Effects between two ports of a simulator: those of one port acting on the difference, and special ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..effects import Effect
from ..effects.backlash import Play
from ..effects.leakage import Passage
from .links import Link
from .placement import Placement, Scales
from .placing import GAP, STRAIN, PortPlace, follows_motion, hidden_of
from .reciprocity import factor_of

if TYPE_CHECKING:
    from .sizes import SignalSizes


ONE_BODY = ("load", "drive")
"""Families of effects of a load on one end, or of its drive: they make no sense between two."""


def at_link(link: Link, survey: SignalSizes, known: Mapping[str, tuple[str, type[Effect]]]) -> list[Placement]:
    """Return the effects between two ports: those of one port acting on the difference, and special ones."""
    motion, span = link.domain == "motion", survey.spans.get(next(iter(link.sources)), 0.0)
    if not span > 0.0:
        return []
    gaps = [survey.gaps.get(end.port, survey.gaps.get(end.state, 0.0)) for end in link.ends]
    size = max(gap / typical for gap, typical in zip(gaps, link.typical, strict=True))
    found = []
    for name, (kind, one_port) in known.items():
        effect = Passage if name == "leakage" else one_port
        if kind not in (("joint", "link") if motion else ("chamber",)) or effect.family in ONE_BODY:
            continue
        scale, head = 1.0, {}
        if motion:
            if not follows_motion(effect) or name == ("spring" if link.stiffness else "backlash"):
                continue
            scale, hidden = span / STRAIN, hidden_of(effect, neutral=False)
        elif effect.domain != link.domain or name == "overflow":
            continue
        else:
            hidden = ("ambient",) if link.domain == "temperature" else ()
            ambient = {p.name: p.nominal for p in effect.parameters}.get("ambient", 0.0)
            head = {"pressure": factor_of(link.first.unit), "offset": ambient}
        scales = Scales(scale, survey.time, size / GAP["force" if motion else "flow"] or 1.0, **head)
        place = PortPlace(
            link.name, "joint" if motion else "chamber", "link", link.first.state, scales, link.unit, link.first.unit,
            link.follows, range_of=span / scale,
            speed=scales.speed(survey.spans.get(link.follows.get("velocity", ""), 0.0)),
        )  # fmt: skip
        made = replace(place.placed(name, effect, hidden), link=link)
        if effect is Play:
            held, damped = link.stiffness * scale, link.damping * scale * survey.time
            own: dict[str, Any] = {"stiffness": held / scales.target, "damping": damped / scales.target}
            units = {"half_width": link.first.unit}
            made = replace(made, effect=Play.narrowed(**own), powers={"half_width": 1}, units=units)
        found.append(made)
    return found

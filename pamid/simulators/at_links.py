"""Effects between two ports of a simulator: those of one port acting on the difference, and special ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..effects import Effect
from ..effects.backlash import Play
from ..effects.leakage import Passage
from .dimensions import unit_powers
from .links import Link
from .placement import Placement, Scales
from .placing import GAP, STRAIN, follows_motion
from .placing import placed as place_at
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
        scale, hidden, head = 1.0, tuple(p.name for p in effect.parameters if "Pa" in unit_powers(p.unit)), {}
        if kind not in (("joint", "link") if motion else ("chamber",)) or effect.family in ONE_BODY:
            continue
        if motion:
            if not follows_motion(effect) or name == ("spring" if link.stiffness else "backlash"):
                continue
            scale = span / STRAIN
        elif effect.domain != link.domain or name == "overflow":
            continue
        else:
            hidden = ("ambient",) if link.domain == "temperature" else ()
            ambient = {p.name: p.nominal for p in effect.parameters}.get("ambient", 0.0)
            head = {"pressure": factor_of(link.first.unit), "offset": ambient}
        scales = Scales(scale, survey.time, size / GAP["force" if motion else "flow"] or 1.0, **head)
        follows = {r: s for r, s in link.follows.items() if r in effect.roles}
        placed = place_at(
            name, effect, link.name, "force" if motion else "flow", "link", link.first.state, follows, scales,
            link.unit, link.first.unit, hidden, 0.0 if name == "quadratic_drag" else None, range_of=span / scale,
            speed=scales.speed(survey.spans.get(link.follows.get("velocity", ""), 0.0)),
        )  # fmt: skip
        placed = replace(placed, link=link)
        if effect is Play:
            held, damped = link.stiffness * scale, link.damping * scale * survey.time
            own: dict[str, Any] = {"stiffness": held / scales.target, "damping": damped / scales.target}
            bound = effect.narrowed(**own)
            placed = replace(placed, effect=bound, powers={"half_width": 1}, units={"half_width": link.first.unit})
        found.append(placed)
    return found

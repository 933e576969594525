"""What a diagnosis does not test, although a user asked for it or would expect it, and how to have it tested."""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import UnknownOptionError
from ...simulators.catalogue import port_effects
from ...simulators.likeness import dimension
from ...simulators.structure import why_left_out
from .ports import PortEvidence

MOVES = {"angle", "angular rate", "speed"}
"""Dimensions of signals of what moves; a length may be a level."""
JOINT = (
    'For each part that moves, add a port to the simulator file: NAME = {{ kind = "joint", position = {signal}, '
    "velocity = {signal}, through = INPUT }}, where INPUT is the one through which forces act there"
)
READ = "; the log needs one of the two outputs"


def untested(evidence: PortEvidence, effects: str | Sequence[str]) -> list[str]:
    """Return notes on effects that were asked for and have no place; raise where none has."""
    wanted = [effects] if isinstance(effects, str) else list(dict.fromkeys(effects))
    # Of a choice of more than half of the library the names were not picked one by one.
    if effects == "all" or 2 * len(port_effects().keys() & set(wanted)) > len(port_effects()):
        why = f"No joint is known, so friction and play are not tested. {_add_joint(evidence)}."
        return [*_left_out(evidence), *([why] if _lacks_joint(evidence) else [])]
    left_out: dict[str, list[str]] = {}
    for name in wanted:
        places = evidence.library([name])
        if not any(evidence.has(key) for key in places):
            left_out.setdefault(_why(name, bool(places), evidence), []).append(name)
    notes = [f"Not tested: {', '.join(names)}, since {why}." for why, names in left_out.items()]
    if wanted and sum(map(len, left_out.values())) == len(wanted):
        raise UnknownOptionError(
            f"No effect that was asked for can be tested. {' '.join(notes)}",
            "effects that can act at ports of this simulator",
            "Name others, or leave --effects (`effects`) out: then all that can act are tested.",
        )
    return notes


def _lacks_joint(evidence: PortEvidence) -> bool:
    """Return whether something seems to move, yet no joint is known."""
    known = port_effects()
    placed = {known[p.name][0] for p in evidence.placements.values() if p.name in known}
    read = [p for p in evidence.simulator.ports if p.kind in ("output", "state")]
    if _left_out(evidence):
        return False  # each says why it is none
    return "joint" not in placed and not evidence.joints and any(dimension(p.unit) in MOVES for p in read)


def _left_out(evidence: PortEvidence) -> list[str]:
    """Return a note on each joint that the user named, and that is none here."""
    if evidence.simulator.form != "run":
        return []
    known, named = {j.name for j in evidence.joints}, [p for p in evidence.simulator.ports if p.kind == "joint"]
    return [f"{why_left_out(p)} Friction and play are not tested there." for p in named if p.name not in known]


def _add_joint(evidence: PortEvidence) -> str:
    """Return how a joint is named in the simulator file."""
    if evidence.simulator.form == "ode":
        return JOINT.format(signal="STATE")
    return JOINT.format(signal="OUTPUT") + READ


def _why(name: str, placed: bool, evidence: PortEvidence) -> str:
    """Return the reason why an effect cannot be tested here."""
    if placed:
        return "the log has no readings of what it acts on"
    kind = port_effects().get(name, ("bench",))[0]
    if kind in ("joint", "encoder"):
        return f"no joint is known. {' '.join(_left_out(evidence)) or _add_joint(evidence)}".removesuffix(".")
    return "no pair of joints or chambers is known" if kind == "link" else f"no {kind} of this simulator can have it"

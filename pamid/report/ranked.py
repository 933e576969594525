"""What the ranking says of each candidate: how likely it is, what it closes, why it is not the answer."""

import math

from ..gap.diagnosis.findings import Candidate, Cause
from ..gap.diagnosis.result import Diagnosis
from .quantities import NOT_EFFECTS, percent, places, probability


def _cause_of(d: Diagnosis, c: Candidate) -> Cause | None:
    """Return the cause of the answer that a candidate is, or is one reading of."""
    return next((x for x in d.causes if (c.effect, c.where) in zip(x.effects, places(x), strict=True)), None)


def certainty(d: Diagnosis, c: Candidate) -> float:
    """Return the probability that a candidate is a cause; each of several causes may be certain."""
    cause = _cause_of(d, c)
    if d.verdict != "several" or cause is None:
        return c.confidence
    readings = sum(x.confidence for x in d.candidates if _cause_of(d, x) is cause)
    return cause.confidence * c.confidence / readings if readings > 0.0 else cause.confidence


def closes(d: Diagnosis, c: Candidate) -> str:
    """Return the share of the gap that a candidate closes alone, or as one of several causes with the others."""
    if c.effect in NOT_EFFECTS:
        return ""
    cause = _cause_of(d, c)
    if d.verdict == "several" and cause is not None and c.effect == cause.effects[0]:
        return f"{percent(cause.share)} with the others"
    return percent(c.closed_share) if math.isfinite(c.closed_share) else "–"


def reason(d: Diagnosis, c: Candidate) -> str:
    """Return why a candidate is not the answer; empty where nothing speaks against it."""
    if c.ruled_out:
        return c.ruled_out
    if c.effect == "none" and d.gap:
        return f"the error is more than noise ({probability(d.p_value)})"
    return "effects of the library explain it" if c.effect == "unknown" and d.causes else ""

"""The part of a log in which causes are searched, for slow simulators that evaluate one instant at a time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...simulators.port_log import PortLog
from .direct import DirectEvidence

MOST_ANSWERS = 15_000
"""Most rows times joints in which causes are searched: each effect asks a model with six joints some 20 µs a row."""
STRETCHES = 6
"""Stretches of a log that its part consists of: as many as may differ, each long beside what effects remember."""


def part_of(log: PortLog, rows: int, stretches: int = STRETCHES) -> PortLog:
    """Return stretches of a log, evenly spread over it, as separate runs."""
    if log.n <= rows:
        return log
    length = max(rows // stretches, 1)
    whole = [(a + k * length, a + (k + 1) * length, run) for run, (a, b) in enumerate(log.spans)
             for k in range((b - a) // length)]  # fmt: skip
    whole = whole or [(a, b, run) for run, (a, b) in enumerate(log.spans)]  # runs as short as that
    count = max(1, min(len(whole), rows // min(length, max(b - a for a, b, _ in whole))))
    kept = [whole[k] for k in np.unique(np.arange(count) * len(whole) // count)]
    at = np.concatenate([np.arange(a, b) for a, b, _ in kept])
    starts = np.cumsum([0, *(b - a for a, b, _ in kept)])[:-1]
    names = [f"{log.names[run]} from {log.t[a]:.4g} s" for a, _, run in kept]
    return PortLog(
        {k: x[at] for k, x in log.channels.items()}, log.t[at], starts, log.dt, names,
        {k: gap[at] for k, gap in log.gaps.items()}, list(log.notes),
        {k: rows.at(at) for k, rows in log.between.items()},
    )  # fmt: skip


def to_search(evidence: DirectEvidence) -> DirectEvidence:
    """Return the evidence in which causes are searched: all of it, or of a part of the log, in the same units."""
    if not evidence.simulator.one_by_one or not evidence.joints:
        return evidence
    part = part_of(evidence.log, MOST_ANSWERS // len(evidence.joints))
    if part is evidence.log:
        return evidence
    found = DirectEvidence(part, evidence.given, evidence.derived, lines=evidence.lines)
    if found.equations != evidence.equations or found.joints != evidence.joints:
        return evidence  # joints that move elsewhere rest in the part
    found.begin_as(evidence)
    found.measure_as(evidence.sizes)
    return found


def remember_as(evidence: DirectEvidence, part: DirectEvidence) -> None:
    """Give the noise of a whole log the correlation time of its part."""
    for k, (own, its) in enumerate(zip(evidence.parts, part.parts, strict=True)):
        step, other = _step(evidence, own), _step(part, its)
        if step > 0.0 and other > 0.0:
            evidence.weights[k] = 1.0 / max(float(evidence.memory[k]), other / step / float(part.weights[k]), 1.0)
    evidence.stretch = max(evidence.stretch, part.stretch)


def _step(evidence: DirectEvidence, part: slice) -> float:
    """Return the time from one window to the next."""
    steps = [y - x for x, y in pairwise(evidence.time[part][:200].tolist()) if y > x]
    return float(np.median(steps)) if steps else 0.0

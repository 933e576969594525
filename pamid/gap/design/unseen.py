"""Effects that the logs so far could not have shown: the purpose of a run where nothing else is undecided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..diagnosis.rivals import Rival
from ..residuals.bench import Evidence
from ..settings import TOLERANCE
from .expected_cost import expected_cost
from .known import fit_of

MOST = 6
"""Number of effects that one run is designed to show."""


def unseen(logs: Sequence[Evidence], base: Rival, library: Sequence[str], shown: float) -> list[Rival]:
    """Return no effect, and the effects that would hardly have shown in logs at their typical size."""
    found = []
    for name in library:
        if not any(log.touched([name]) for log in logs):
            continue  # no run shows an effect on a channel that no equation reads
        typical = {p.name: float(p.nominal) for p in logs[0].effects[name].parameters}
        cost = sum(_cost(log, {name: typical}, base) for log in logs)
        if cost < shown:
            found.append((cost, Rival({name: typical}, dict(base.deviations), 0.0, 0.0)))
    found.sort(key=lambda f: f[0])
    rivals = [base, *(rival for _, rival in found[:MOST])]
    return [Rival(r.effects, r.deviations, r.score, 1.0 / len(rivals)) for r in rivals]


def _cost(log: Evidence, spec: dict[str, dict[str, float]], base: Rival) -> float:
    """Return the cost of omitting an effect from the simulator on a log, its tolerances refitted."""
    x = fit_of(base, log).x
    d = log.change(spec, {}, x)
    H = log.J.T @ log.J + TOLERANCE * np.eye(len(x))
    step = np.linalg.solve(H, log.J.T @ d)
    left = d - log.J @ step
    parts = [float(expected_cost(left[part, None], 0.0)[0][0]) for part in log.parts if part.stop > part.start]
    return sum(parts) + 0.5 * TOLERANCE * float(step @ step)

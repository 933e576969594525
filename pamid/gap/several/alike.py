"""Whether several logs can be of one bench."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from ...errors import IncompatibleError, MissingColumnError
from ..residuals.bench import Evidence

FACTOR = 1.5
"""How far, as a factor, what is measured may differ between logs beside what one simulator says of each: more than any
tolerance, sensor or missing effect makes of it; a wrong unit makes more, and so does another muscle."""
PROPORTIONAL = 0.9
"""Share of what is measured that is a factor times what the simulator says, from which it is a factor: a valve that
saturates in one log and not in another one leaves less."""


def check_alike(logs: Mapping[str, Evidence]) -> None:
    """Raise where logs cannot be of one bench."""
    for (one, a), (two, b) in combinations(logs.items(), 2):
        if not set(a.equations) & set(b.equations):
            lacks = [f"{x} lacks {', '.join(c)}" for x, c in ((one, _lacks(a, b)), (two, _lacks(b, a))) if c]
            raise MissingColumnError(
                f"{' and '.join(lacks)}{': ' * bool(lacks)}{one} allows the equations "
                f"{', '.join(a.equations) or 'none'}, {two} {', '.join(b.equations) or 'none'}.",
                "logs with the same columns",
                "Map the columns of both logs in the same way; a cause can only be shared if both logs can show it.",
            )
        for equation in (e for e in a.equations if e in b.equations and e != "joint"):
            first, second = _size(a, equation), _size(b, equation)
            if first is None or second is None:
                continue
            ratio = max(first / second, second / first)
            if ratio > FACTOR:
                raise IncompatibleError(
                    f"Of what the simulator says of the {equation}, {one} measures {first:.3g} times as much and {two} "
                    f"{second:.3g} times.",
                    "logs of one bench, in the same units",
                    f"Check the units of {two if abs(np.log(second)) > abs(np.log(first)) else one}, or diagnose the "
                    "logs of different benches one by one.",
                )


def _lacks(evidence: Evidence, other: Evidence) -> list[str]:
    """Return the columns that another log has."""
    return [c for c in other.columns if c not in evidence.columns]


def _size(evidence: Evidence, equation: str) -> float | None:
    """Return the factor between what is measured and what the simulator says; None where there is none."""
    part = evidence.parts[evidence.equations.index(equation)]
    measured, residual = evidence.measured[part], evidence.raw(evidence.z0)[part] * evidence.noise[part]
    said = measured - residual
    across = float(np.sum(np.abs(measured * said)))
    if not across > 0.0 or np.sqrt(np.mean(said**2)) < 10.0 * np.median(evidence.noise[part]):
        return None
    product = float(np.sum(measured * said))
    proportional = product**2 >= PROPORTIONAL * float(np.sum(said**2)) * float(np.sum(measured**2))
    return product / float(np.sum(said**2)) if product > 0.0 and proportional else None

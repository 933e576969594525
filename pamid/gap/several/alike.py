"""Whether several logs can come from one bench."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from ...errors import IncompatibleError, MissingColumnError
from ..residuals.bench import Evidence

FACTOR = 1.5
"""How far, as a factor, what is measured may differ between logs relative to one simulator: more than any tolerance,
sensor or missing effect causes; a wrong unit or another muscle causes more."""
PROPORTIONAL = 0.9
"""Share of the measured signal that must be proportional to the simulated one for a factor to be found: a valve that
saturates in only one log leaves less."""


def check_alike(logs: Mapping[str, Evidence]) -> None:
    """Raise where logs cannot come from one bench."""
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
                    f"The measured {equation} is {first:.3g} times the simulator's in {one}, and {second:.3g} times in "
                    f"{two}.",
                    "logs of one bench, in the same units",
                    f"Check the units of {two if abs(np.log(second)) > abs(np.log(first)) else one}, or diagnose the "
                    "logs of different benches one by one.",
                )


def _lacks(evidence: Evidence, other: Evidence) -> list[str]:
    """Return the columns that another log has."""
    return [c for c in other.columns if c not in evidence.columns]


def _size(evidence: Evidence, equation: str) -> float | None:
    """Return the factor between measured and modelled values; None where there is none."""
    part = evidence.parts[evidence.equations.index(equation)]
    measured, residual = evidence.measured[part], evidence.raw(evidence.z0)[part] * evidence.noise[part]
    said = measured - residual
    across = float(np.sum(np.abs(measured * said)))
    if not across > 0.0 or np.sqrt(np.mean(said**2)) < 10.0 * np.median(evidence.noise[part]):
        return None
    product = float(np.sum(measured * said))
    proportional = product**2 >= PROPORTIONAL * float(np.sum(said**2)) * float(np.sum(measured**2))
    return product / float(np.sum(said**2)) if product > 0.0 and proportional else None

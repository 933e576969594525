"""The corrected simulator of a diagnosis, run again on its log: what it closes there, beside what was predicted."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pandas as pd

from ..errors import PamidError
from .diagnosis.result import Diagnosis

if TYPE_CHECKING:
    from .residuals.ports import PortEvidence


def closes(d: Diagnosis, log: pd.DataFrame, simulator: Any, like: PortEvidence | None = None) -> dict[str, float]:
    """Return the share that a simulator closes of each equation's gap of which the report says how far it shrinks.

    Predictions go over the same stretches as those of other evidence: errors over others do not compare.
    """
    from .evaluation import errors_of, evaluate, residuals_of

    known = {c.equation: c.again for c in d.closure if not math.isnan(c.again)}
    if simulator is d.corrected and known:
        return known
    found = evaluate(log, simulator) if like is None else errors_of([residuals_of(log, simulator, like)])
    shares = {}
    for c in d.closure:
        alike = c.equation in found and found[c.equation].unit == c.unit  # rates are not judged by predictions
        if alike and not c.allowed:  # the report says what else it takes
            shares[c.equation] = c.closed_by(found[c.equation].rmse)
    return shares


def tried(d: Diagnosis, log: pd.DataFrame, like: PortEvidence | None = None) -> Diagnosis:
    """Return a diagnosis with what the corrected simulator closes, in which no cause is sure if that is too little.

    Residuals of the equations are linear in a law at the logged states; a simulator that is solved anew weighs them by
    its own inertia and noise.
    """
    if d.corrected is None or d.interrupted or not d.added:
        return d
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # all of them were told at the beginning
            shares = closes(d, log, d.corrected, like)
    except PamidError:  # a simulator that does not follow the log is told where it is written
        return d
    closure = [replace(c, again=shares.get(c.equation, math.nan)) for c in d.closure]
    left = {c.equation for c in closure if c.ci90[0] > 1.0 - c.ci90[0] and c.again < 1.0 - c.again}
    sure = [c.equation in left and c.grade == "sure" for c in d.causes]
    causes = [replace(c, with_reserve=True, grade="reserve") if s else c for c, s in zip(d.causes, sure, strict=True)]
    return replace(d, closure=closure, causes=causes, with_reserve=any(c.with_reserve for c in causes))

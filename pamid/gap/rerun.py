"""The corrected simulator of a diagnosis, run again on its log: what it closes there, beside what was predicted."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import pandas as pd

from ..errors import PamidError
from .diagnosis.result import Diagnosis


def closes(d: Diagnosis, log: pd.DataFrame, simulator: Any) -> dict[str, float]:
    """Return the share that a simulator closes of each equation's gap of which the report says how far it shrinks."""
    from . import evaluate

    found, shares = evaluate(log, simulator), {}
    for c in d.closure:
        alike = c.equation in found and found[c.equation].unit == c.unit  # rates are not judged by predictions
        if alike and not c.allowed:  # the report says what else it takes
            shares[c.equation] = c.closed_by(found[c.equation].rmse)
    return shares


def tried(d: Diagnosis, log: pd.DataFrame) -> Diagnosis:
    """Return a diagnosis in which no cause is sure with which the simulator leaves most of what it should close.

    Residuals of the equations are linear in a law at the logged states; a simulator that is solved anew weighs them by
    its own inertia and noise.
    """
    if d.corrected is None or d.interrupted or not any(c.grade == "sure" for c in d.causes):
        return d
    said = {c.equation for c in d.closure if c.ci90[0] > 1.0 - c.ci90[0]}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # all of them were told at the beginning
            shares = closes(d, log, d.corrected) if said else {}
    except PamidError:  # a simulator that does not follow the log is told where it is written
        return d
    left = {equation for equation, share in shares.items() if equation in said and share < 1.0 - share}
    sure = [c.equation in left and c.grade == "sure" for c in d.causes]
    causes = [replace(c, with_reserve=True, grade="reserve") if s else c for c, s in zip(d.causes, sure, strict=True)]
    return replace(d, causes=causes, with_reserve=any(c.with_reserve for c in causes))

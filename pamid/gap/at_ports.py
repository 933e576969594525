"""The diagnosis of any simulator with ports: which effect, at which port, and the corrected simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..simulators.base import Simulator
from ..simulators.catalogue import chosen
from .diagnosis.result import Diagnosis
from .engine import explain, rows_searched
from .inference.so_far import where_so_far
from .inference.student_t import scale
from .readings import settled
from .residuals.direct import DirectEvidence
from .residuals.part import remember_as, to_search
from .simulated import evidence_of, learn, outward, runner

if TYPE_CHECKING:
    import pandas as pd


def diagnose_at_ports(
    log: pd.DataFrame, simulator: Simulator, effects: str | Sequence[str], seed: int, say: Callable[[str], None]
) -> Diagnosis:
    """Diagnose one log of a simulator with ports."""
    from threadpoolctl import threadpool_limits

    evidence = evidence_of(log, simulator, refit=True)
    asked = chosen(evidence.placements, effects)
    # Thousands of small products: threads would only wait for one another.
    with threadpool_limits(1):
        searched = to_search(evidence) if isinstance(evidence, DirectEvidence) else evidence
        asked = settled(evidence, evidence.log, simulator, asked, say)
        if searched is not evidence:
            settled(searched, searched.log, simulator, asked, say)
        say("estimate what could be explained")
        say(where_so_far(searched.equations, np.array([scale(searched.z0[p], 0.0) for p in searched.parts])))
        known, interrupted = learn(searched, asked, say)
        library = [name for name in asked if known.get(name)]
        notes = [f"The residuals are {evidence.how}.", *evidence.notes]
        if isinstance(searched, DirectEvidence) and isinstance(evidence, DirectEvidence) and searched is not evidence:
            remember_as(evidence, searched)
            notes.append(rows_searched(searched.log.n, evidence.log.n))
        found = explain(
            evidence, library, np.random.RandomState(seed), notes, say, searched, known, interrupted, runner(searched)
        )
    return outward(found, evidence)

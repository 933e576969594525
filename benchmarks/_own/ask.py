"""One diagnosis as plain data, with how often it evaluated the simulator."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Any
from unittest import mock

import pandas as pd

from benchmarks._answers import Record, answer_of


def ask(log: pd.DataFrame, simulator: Any, effects: Any = "all") -> Record:
    """Diagnose; ``runs`` are whole runs over the log, or of rates evaluations, as multiples of its rows."""
    from pamid.gap import diagnose_simulator

    counts = {"runs": 0.0, "rates": 0.0}
    kind, begun = type(simulator), time.perf_counter()
    with ExitStack() as stack:
        stack.enter_context(mock.patch.object(kind, "rate", _counting(kind.rate, counts, "rates")))
        stack.enter_context(mock.patch.object(kind, "runs", _counting(kind.runs, counts, "runs")))
        found = diagnose_simulator(log, simulator, effects, seed=0)
    whole = {k: v / len(log) for k, v in counts.items()}
    return answer_of(found) | {"took": time.perf_counter() - begun} | whole


def _counting(method: Any, counts: dict[str, float], what: str) -> Any:
    def counted(self: Any, t: Any, second: Any, *more: Any) -> Any:
        counts[what] += len(second) * len(t) if what == "runs" else second.shape[1]
        return method(self, t, second, *more)

    return counted


def names_of(answer: Record) -> list[set[str]]:
    """Return the classes of names that an answer gives, ``effect@port``."""
    return [set(cause["names"]) for cause in answer["causes"]]

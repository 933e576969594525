"""Causes whose physics has two sides are named on either side, on logs of the library's own effect."""

from __future__ import annotations

import pytest
from support.bench_logs import NOMINAL, RUNS

from pamid.bench import simulate
from pamid.gap import diagnose


def test_ends_that_yield_and_ends_that_are_stiff_are_one_cause() -> None:
    k = 1.07  # stiff ones are among those of a bench, in test_effects_recovered.py
    log = simulate(NOMINAL.replace(effects=[("effective_contraction", {"factor": k})]), RUNS, seed=7)
    found = diagnose(log, NOMINAL)
    assert [c.effects for c in found.causes] == [("end_cap",)]
    assert found.causes[0].parameters["factor"].value == pytest.approx(k, abs=0.005)

"""A simulated log and its diagnoses, shared by the tests of the report."""

from __future__ import annotations

import pandas as pd
import pytest
from support.diagnoses import TRUE, VERDICTS, diagnosis_of, windows_of

from pamid.bench import BenchParameters, simulate
from pamid.bench.references import sine, step, triangle
from pamid.gap.diagnosis.result import Diagnosis


@pytest.fixture(scope="session")
def material() -> tuple[BenchParameters, BenchParameters, pd.DataFrame]:
    nominal = BenchParameters.for_muscle("B")
    actual = nominal.replace(effects=(TRUE,))
    runs = [sine(4, 15, 1800), sine(10, 8, 1000), triangle(4, 20, 1600), step(0, 12, 1000)]
    log = simulate(actual, runs, seed=0)
    return nominal, actual, windows_of(log, nominal, actual)


@pytest.fixture(scope="session")
def diagnoses(material) -> dict[str, Diagnosis]:
    return {verdict: diagnosis_of(verdict, material) for verdict in VERDICTS}

"""A script as a user writes it, for ``mypy --strict`` against an installed pamid: what is wrong must be seen.

Each wrong line carries the error that mypy has to report; an error that is not reported is an unused ``ignore`` and an
error of its own.
"""

from __future__ import annotations

from typing import assert_type

import pandas as pd
from pamid.estimators import *  # noqa: F403
from pamid.estimators import GeometricForce, RateTransformer, StaticPIHM, all_estimators

import pamid
from pamid import BenchParameters, load, read_log, save, simulate
from pamid.compare import compare
from pamid.plots import ForceMapDisplay
from pamid.report import write_report
from pamid.signals import TrajectoryKFold, differentiate
from pamid.survey import Survey
from pamid.systems import all_systems, read_system

log = read_log("log.csv")
assert_type(log, pd.DataFrame)
model = StaticPIHM(rest_length=0.2, rest_diameter=0.02)
assert_type(model, StaticPIHM)
MLP(hidden=(8,), random_state=0)  # noqa: F405
bench = BenchParameters.for_muscle("B")
assert_type(bench, BenchParameters)
save(model, "model.pamid")

StaticPIHM(rest_lenght=0.2)  # type: ignore[call-arg]
GeometricForce("chou_hannaford", rest_diametre=0.02)  # type: ignore[call-arg]
RateTransformer(cut_off=3)  # type: ignore[call-arg]
pamid.simulte  # type: ignore[attr-defined]  # noqa: B018
pamid.estimators.StaticPINN  # type: ignore[attr-defined]  # noqa: B018
simulate(bench, sed=0)  # type: ignore[call-arg]
TrajectoryKFold(splits=5)  # type: ignore[call-arg]

__all__ = [
    "ForceMapDisplay", "Survey", "all_estimators", "all_systems", "compare", "differentiate", "load", "read_system",
    "write_report",
]  # fmt: skip

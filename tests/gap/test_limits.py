"""Limits that signals reach only now and then: found alone and beside a stronger cause."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GapDiagnoser
from sklearn.base import BaseEstimator, RegressorMixin

from pamid.bench import BenchParameters, Controller, simulate, sine, step
from pamid.effects import Parameter
from pamid.gap import diagnose
from pamid.gap.design.family import DesignedRun
from pamid.gap.inference.sensitivity import grid

NOMINAL = BenchParameters.for_muscle("B").replace(
    tolerance={"rest_diameter": 0.005, "braid_angle": 0.005, "sonic_conductance": 0.02, "inertia": 0.02}
)


class LinearForce(RegressorMixin, BaseEstimator):
    """A cylinder with a spring."""

    def fit(self, X: pd.DataFrame, y: np.ndarray | None = None) -> LinearForce:
        self.n_features_in_ = X.shape[1]
        return self

    def predict(self, X: pd.DataFrame) -> np.ndarray:
        position, pressure = (np.asarray(X[name]) for name in ("position", "pressure"))
        return 1.5e-3 * (pressure - 1e5) - 900.0 * position


def test_a_valve_that_saturates_is_found_beside_a_stronger_cause() -> None:
    limit = 0.9
    actual = NOMINAL.replace(effects=[("joint_damping", {"difference": 0.15}), ("valve_saturation", {"limit": limit})])
    log = simulate(actual, [sine(2, 15, 1500), step(0, 25, 1500), sine(6, 10, 1500), step(5, 25, 1500)], seed=1)
    beyond = np.mean(np.abs(log[["u1", "u2"]].to_numpy()) > limit)
    assert 0.0 < beyond < 0.05  # in few windows
    found = diagnose(log, NOMINAL, ["joint_damping", "valve_saturation", "valve_lag", "supply_droop", "leakage"])
    assert {name for cause in found.causes for name in cause.effects} == {"joint_damping", "valve_saturation"}
    [saturation] = [cause for cause in found.causes if cause.effects == ("valve_saturation",)]
    assert saturation.parameters["limit"].value == pytest.approx(limit, abs=0.02)


def test_a_limit_is_found_far_below_full_opening_where_commands_stay_small() -> None:
    share = 0.85
    run = DesignedRun("steps", 1.5, frequency=13.0, amplitude=14.0).trajectory("steps")
    calm = Controller(pressure_time=0.1, bandwidth=10.0)
    most = float(simulate(NOMINAL, [run], seed=0, controller=calm)[["u1", "u2"]].abs().max().max())
    assert most < 0.3
    limited = [("valve_saturation", {"limit": share * most})]
    log = simulate(NOMINAL, [run], effects=limited, seed=0, controller=calm)
    found = diagnose(log, NOMINAL, ["valve_saturation", "supply_droop", "valve_asymmetry"])
    assert [cause.effects for cause in found.causes] == [("valve_saturation",)]
    assert found.causes[0].parameters["limit"].value == pytest.approx(share * most, rel=0.01)


def test_a_reading_that_saturates_is_found_from_what_the_model_reaches() -> None:
    rng, parts = np.random.default_rng(0), []
    for run in range(4):
        time = np.arange(1200) * 0.005
        slow, fast = rng.uniform(0.3, 1.5, 2)
        position = 0.1 + 0.06 * (np.sin(2 * np.pi * slow * time) + 0.6 * np.sin(2 * np.pi * fast * time + run))
        pressure = 3e5 + 1.2e5 * np.sin(2 * np.pi * rng.uniform(0.1, 0.6) * time)
        parts.append(pd.DataFrame({"time": time, "position": position, "pressure": pressure, "run": run}))
    X = pd.concat(parts, ignore_index=True)
    force = LinearForce().predict(X)
    limit = float(np.quantile(np.abs(force), 0.93))
    y = np.clip(force, -limit, limit) + rng.normal(0.0, 0.5, len(X))  # with noise: a plain clip would be told as such
    columns = ["time", "position", "pressure"]
    found = GapDiagnoser(LinearForce(), random_state=0).fit(X[columns], y, groups=X["run"])
    assert [cause.effects for cause in found.causes_] == [("output_saturation",)]
    assert found.causes_[0].parameters["limit"].value == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize("top", [1.0, 2.54, 51.2632, 417.3])
def test_the_grid_of_a_limit_stays_within_its_bounds(top: float) -> None:
    limit = Parameter("limit", "N", 0.05 * top, top, 0.6 * top, "largest value", idle=True)
    points = grid(limit, 1)
    assert all(limit.lower <= x < limit.upper for x in points)
    assert np.all(np.diff(points) < 0)

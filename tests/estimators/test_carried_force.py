"""Named effects carried from one muscle to another: what is found, what is kept, what is refused."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import CarriedForce
from sklearn.frozen import FrozenEstimator

from pamid.effects._equivalent import MEMORIES, pasts
from pamid.errors import AdaptationWarning, FitError, IncompatibleError, MissingTrajectoryError
from pamid.volume.braided import chou_hannaford

READ = ["trajectory", "time", "eps", "P"]


def log(diameter: float, gain: float, seed: int, lag: float = 1.0, runs: int = 6) -> pd.DataFrame:
    """Clamped muscles filled in steps; what they pull follows the pressure by 60 ms."""
    rng = np.random.default_rng(seed)
    tables = []
    for k in range(runs):
        P = 101325.0 + np.repeat(rng.uniform(2e5, 6e5, 8), 50)
        behind = P + lag * pasts(P, 0.01, np.array([0]))[:, MEMORIES.index("tube_60ms")]
        eps = np.full(len(P), 0.05 * (k % 4))
        F = gain * chou_hannaford(behind, eps, rest_diameter=diameter, braid_angle=0.45) + rng.normal(0.0, 0.5, len(P))
        tables.append(
            pd.DataFrame({"trajectory": f"run {k}", "time": 0.01 * np.arange(len(P)), "eps": eps, "P": P, "F": F})
        )
    return pd.concat(tables, ignore_index=True)


@cache
def source() -> CarriedForce:
    table = log(0.01, 1.0, 0)
    weight = np.zeros(len(table))
    weight[::8] = 1.0
    return CarriedForce(rest_diameter=0.01, max_samples=200).fit(table[READ], table["F"], sample_weight=weight)


def weights(table: pd.DataFrame, count: int) -> np.ndarray:
    weight = np.zeros(len(table))
    weight[np.linspace(0, len(table) - 1, count).astype(int)] = 1.0
    return weight


def rmse(model: CarriedForce, table: pd.DataFrame) -> float:
    return float(np.sqrt(np.mean((model.predict(table[READ]) - table["F"]) ** 2)))


def test_a_few_samples_of_another_bore_do_with_a_source() -> None:
    few, unseen = log(0.02, 0.8, 1), log(0.02, 0.8, 2)
    weight = weights(few, 12)
    carried = CarriedForce(FrozenEstimator(source()), rest_diameter=0.02).fit(few[READ], few["F"], sample_weight=weight)
    alone = CarriedForce(rest_diameter=0.02).fit(few[READ], few["F"], sample_weight=weight)
    assert carried.source_kept_ == 1.0
    assert np.exp(carried.parameters_["gain"]) == pytest.approx(0.8, abs=0.05)
    assert rmse(carried, unseen) < 0.5 * rmse(alone, unseen)


def test_another_bore_is_as_unlike_the_source_as_its_samples_say() -> None:
    """A stiffer bladder, and the evidence widens the prior; of the same bore the prior stays as it is."""
    widths = []
    for diameter, stiffness in ((0.02, 0.0), (0.02, 4000.0), (0.01, 1000.0)):
        table = log(diameter, 0.8, 1)
        F = (table["F"] - stiffness * table["eps"]).clip(lower=0.0)
        model = CarriedForce(FrozenEstimator(source()), rest_diameter=diameter)
        widths.append(model.fit(table[READ], F, sample_weight=weights(table, 20)).process_.amplitudes.named)
    alike, unlike, same_bore = widths
    assert alike <= 1.0 < unlike
    assert same_bore == 1.0


def test_the_memory_is_found_and_carried() -> None:
    """The lag is told from runs alone; without it the jumps of the pressure stay in the error."""
    assert sum(source().memory_.values()) == pytest.approx(1.0, abs=0.3)
    table = log(0.01, 1.0, 3)
    plain = CarriedForce(rest_diameter=0.01, pressure_memory=False).fit(
        table[READ], table["F"], sample_weight=weights(table, 200)
    )
    assert rmse(source(), table) < 0.3 * rmse(plain, table)


def test_a_source_that_is_none_gives_way() -> None:
    """Its contraction raises what it pulls: another machine, of which a braid of its own says more."""
    eps, P = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 0.2, 5), np.linspace(1.5e5, 6e5, 12)))
    X, noise = np.c_[eps, P], np.random.default_rng(0).normal(0.0, 0.5, 60)
    F = chou_hannaford(P, eps, rest_diameter=0.01, braid_angle=0.45) + noise
    odd = CarriedForce(rest_diameter=0.01, pressure_memory=False).fit(X, 400.0 * (1.0 - P / 7e5) + 2000.0 * eps)
    with pytest.warns(AdaptationWarning, match="The source helps little"):
        model = CarriedForce(FrozenEstimator(odd), rest_diameter=0.01, pressure_memory=False).fit(X, F)
    assert model.source_kept_ < 0.5
    assert model.score(X, F) > 0.999


def test_a_carried_model_is_a_source_again() -> None:
    first, second = log(0.02, 0.8, 5), log(0.02, 0.9, 6)
    B = CarriedForce(FrozenEstimator(source()), rest_diameter=0.02).fit(first[READ], first["F"], weights(first, 20))
    C = CarriedForce(FrozenEstimator(B), rest_diameter=0.02).fit(second[READ], second["F"], weights(second, 12))
    assert np.exp(C.parameters_["gain"]) == pytest.approx(0.9 / 0.8, abs=0.06)


def test_a_stream_of_whole_runs_ends_where_one_fit_does() -> None:
    table = log(0.01, 1.0, 7, runs=4)
    weight = weights(table, 40)
    whole = CarriedForce(rest_diameter=0.01).fit(table[READ], table["F"], sample_weight=weight)
    streamed = CarriedForce(rest_diameter=0.01)
    for rows in table.groupby("trajectory", sort=False).indices.values():
        part = table.iloc[rows]
        streamed.partial_fit(part[READ], part["F"], sample_weight=weight[rows])
    np.testing.assert_allclose(streamed.predict(table[READ]), whole.predict(table[READ]), rtol=1e-6, atol=1e-6)


def test_what_is_missing_is_said() -> None:
    table = log(0.01, 1.0, 8, runs=2)
    with pytest.raises(MissingTrajectoryError, match="trajectory"):
        CarriedForce().fit(table[["time", "eps", "P"]], table["F"])
    with pytest.raises(IncompatibleError, match="not fitted"):
        CarriedForce(FrozenEstimator(CarriedForce())).fit(table[READ], table["F"])
    with pytest.raises(IncompatibleError, match="pressure_memory=False"):
        CarriedForce(FrozenEstimator(source()), pressure_memory=False).fit(table[READ], table["F"])
    with pytest.raises(FitError, match="1 samples"):
        CarriedForce().fit(table[READ], table["F"], sample_weight=weights(table, 1))

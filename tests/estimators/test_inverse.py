"""Inverse and forward models: they meet unseen loads, follow drift, and say when they are out of their depth."""

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import MLP, ForwardModel, GeometricForce, InverseModel, InvertedForce, PolynomialForce, Recurrent
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

from pamid.bench.single import LiftSettings, simulate_lift
from pamid.errors import (
    ExtrapolationWarning,
    IncompatibleError,
    MissingTrajectoryError,
    ParameterError,
    UnreachableError,
)

COLUMNS = ["trajectory", "F", "eps"]


@pytest.fixture(scope="module")
def lifts():
    """Training under five loads, and runs under loads between them, at four times the frequency of the study."""
    quick = LiftSettings(frequency=0.2)
    train = simulate_lift(loads=(15.0, 30.0, 45.0, 70.0, 100.0), every=20, settings=quick)
    test = simulate_lift(loads=(20.0, 60.0, 90.0), every=50, seed=1, settings=quick)
    return train, test


@pytest.fixture(scope="module")
def inverse(lifts):
    train, _ = lifts
    return InverseModel(direction=True, max_iter=60, n_starts=1, random_state=0).fit(train[COLUMNS], train["P"])


def test_unseen_loads_are_met(lifts, inverse):
    train, test = lifts
    answer = inverse.assess(test[COLUMNS])
    error = np.abs(answer.pressure - test["P"]) / np.ptp(train["P"])
    assert error.max() < 0.05
    assert not answer.saturated.any()
    assert answer.extrapolated.mean() < 0.05
    plain = InverseModel(max_iter=60, n_starts=1, random_state=0, on_unreachable="clip").fit(train[COLUMNS], train["P"])
    spread = np.sqrt(np.mean((plain.predict(test[COLUMNS]) - test["P"]) ** 2))
    assert np.sqrt(np.mean((answer.pressure - test["P"]) ** 2)) < 0.7 * spread, "the direction tells nothing"


def test_out_of_reach_is_flagged_bounded_or_an_error(lifts, inverse):
    train, _ = lifts
    wanted = pd.DataFrame(
        {"trajectory": "w", "F": [4000.0, 300.0, np.float64(train["F"].iloc[600])], "eps": [0.24, 0.5, 0.1]}
    )
    answer = inverse.assess(wanted)
    assert answer.extrapolated[:2].all()
    assert (answer.pressure >= train["P"].min()).all() and (answer.pressure <= train["P"].max()).all()
    with pytest.warns(ExtrapolationWarning, match="3 wanted pairs|of 3"):
        np.testing.assert_array_equal(inverse.predict(wanted), answer.pressure)
    strict = clone(inverse).set_params(on_unreachable="raise", max_iter=10).fit(train[COLUMNS], train["P"])
    with pytest.raises(UnreachableError, match="row 0"):
        strict.predict(wanted)
    assert np.isfinite(strict.predict(train[COLUMNS].iloc[200:260])).all()


def test_a_saturated_pressure_is_the_limit(lifts):
    train, _ = lifts
    limits = (1.2e5, 4e5)
    model = InverseModel(pressure_limits=limits, max_iter=30, n_starts=1, random_state=0).fit(
        train[COLUMNS], train["P"]
    )
    with pytest.warns(ExtrapolationWarning, match="beyond its limits"):
        P = model.predict(train[COLUMNS])
    assert P.min() == limits[0] and P.max() == limits[1]
    saturated = model.assess(train[COLUMNS]).saturated
    assert (
        saturated[train["P"] > 4.5e5].mean() > 0.95 and not saturated[(train["P"] > 2e5) & (train["P"] < 3.5e5)].any()
    )


def test_following_a_drifting_muscle(lifts):
    train, test = lifts
    drifted = test.assign(P=test["P"] + 2e4)
    model = InverseModel(
        direction=True, max_iter=40, n_starts=1, random_state=0, forget_rows=500, on_unreachable="clip"
    ).fit(train[COLUMNS], train["P"])

    def rmse():
        return float(np.sqrt(np.mean((model.predict(drifted[COLUMNS]) - drifted["P"]) ** 2)))

    before = rmse()
    for _ in range(3):
        for _, run in drifted.groupby("trajectory"):
            model.partial_fit(run[COLUMNS], run["P"])
    assert rmse() < 0.5 * before


def test_partial_fit_from_nothing_is_a_fit(lifts):
    train, _ = lifts
    models = [InverseModel(max_iter=5, n_starts=1, random_state=0, on_unreachable="clip") for _ in range(2)]
    models[0].fit(train[COLUMNS], train["P"])
    models[1].partial_fit(train[COLUMNS], train["P"])
    np.testing.assert_array_equal(*(m.predict(train[COLUMNS]) for m in models))


def test_wrong_settings(lifts):
    train, _ = lifts
    X, y = train[["F", "eps"]], train["P"]
    with pytest.raises(MissingTrajectoryError):
        InverseModel(direction=True).fit(X, y)
    with pytest.raises(ParameterError, match="whose direction"):
        InverseModel(("F",), direction=True).fit(X, y)
    with pytest.raises(ParameterError, match="pressure_limits"):
        InverseModel(pressure_limits=(5e5, 1e5)).fit(X, y)
    with pytest.raises(ParameterError, match="on_unreachable"):
        InverseModel(on_unreachable="ignore").fit(X, y)


def test_inverse_of_a_fitted_model(lifts):
    train, test = lifts
    force = GeometricForce("tondu_lopez").fit(train[["eps", "P"]], train["F"])
    kept = InvertedForce(FrozenEstimator(force)).fit(train[["F", "eps"]], train["P"])
    own = InvertedForce(GeometricForce("tondu_lopez")).fit(train[["F", "eps"]], train["P"])
    wanted = test[["F", "eps"]].assign(F=force.predict(test[["eps", "P"]]))
    inside = (test["P"] > train["P"].min() + 1e3) & (test["P"] < train["P"].max() - 1e3)
    for model in (kept, own):
        np.testing.assert_allclose(model.assess(wanted).pressure[inside], test["P"][inside], atol=5.0)


def test_no_root_is_flagged_and_bounded(lifts):
    train, _ = lifts
    model = InvertedForce(on_unreachable="raise").fit(train[["F", "eps"]], train["P"])
    wanted = pd.DataFrame({"F": [1e5, -1e4, 300.0], "eps": [0.05, 0.05, 0.6]})
    answer = model.assess(wanted)
    assert answer.saturated.tolist()[:2] == [True, True]
    assert answer.pressure[0] == pytest.approx(model.pressure_high_) and answer.pressure[1] == model.pressure_low_
    assert answer.extrapolated.tolist() == [False, False, True]
    with pytest.raises(UnreachableError):
        model.predict(wanted)
    with pytest.warns(ExtrapolationWarning):
        model.set_params(on_unreachable="warn").predict(wanted)


def test_an_answer_beyond_the_pressures_of_the_fit_is_flagged(lifts):
    train, _ = lifts
    low = train[train["P"] < 4e5]
    model = InvertedForce(pressure_limits=(1e5, 8e5), on_unreachable="raise").fit(low[["F", "eps"]], low["P"])
    pairs = pd.DataFrame({"eps": [0.05, 0.05], "P": [3e5, 6e5]})
    wanted = pd.DataFrame({"F": model.model_.predict(pairs), "eps": pairs["eps"]})
    answer = model.assess(wanted)
    np.testing.assert_allclose(answer.pressure, pairs["P"], atol=5.0)
    assert answer.extrapolated.tolist() == [False, True] and not answer.saturated.any()
    with pytest.raises(UnreachableError):
        model.predict(wanted)


def test_several_roots_give_the_lowest():
    """A force that rises and falls with the pressure is not refused; the least pressure does it."""
    eps, P = (a.ravel() for a in np.meshgrid(np.linspace(0, 0.2, 5), np.linspace(1e5, 7e5, 25)))
    F = 400.0 - ((P - 4e5) / 2e4) ** 2
    model = InvertedForce(PolynomialForce(2, "surface")).fit(pd.DataFrame({"F": F, "eps": eps}), P)
    answer = model.predict(pd.DataFrame({"F": [300.0], "eps": [0.1]}))
    assert answer[0] == pytest.approx(2e5, abs=10.0)


def test_only_force_models_of_single_rows_can_be_inverted():
    X, y = pd.DataFrame({"F": [1.0, 2.0, 3.0], "eps": [0.0, 0.1, 0.2]}), [1e5, 2e5, 3e5]
    for model in (Recurrent(), MLP(("eps",)), MLP(("eps", "P", "temperature"))):
        with pytest.raises(IncompatibleError, match="reads"):
            InvertedForce(model).fit(X, y)


def test_force_and_contraction_together(lifts):
    train, test = lifts
    inputs, outputs = ["trajectory", "P", "load"], ["F", "eps"]
    model = ForwardModel(direction=True, max_iter=60, n_starts=1, random_state=0).fit(train[inputs], train[outputs])
    answer = model.assess(test[inputs])
    error = np.abs(answer.outputs - test[outputs].to_numpy()) / np.ptp(train[outputs].to_numpy(), axis=0)
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.03
    far = pd.DataFrame({"trajectory": "far", "P": [2e6, 3e5], "load": [500.0, 60.0]})
    with pytest.warns(ExtrapolationWarning, match="1 of 2"):
        z = model.predict(far)
    margin = 0.05 * np.ptp(train[outputs].to_numpy(), axis=0)
    assert (z <= train[outputs].max().to_numpy() + margin + 1e-9).all()
    assert model.assess(far).extrapolated.tolist() == [True, False]


def test_what_a_short_memory_has_let_go_stays_in_the_network():
    rng = np.random.default_rng(0)

    def rows(n, force, contraction):
        F, eps = rng.uniform(*force, n), rng.uniform(*contraction, n)
        P = 1e5 + 400.0 * F + 2e6 * eps + 6e3 * eps**2 * F + 200.0 * rng.standard_normal(n)
        return pd.DataFrame({"F": F, "eps": eps}), P

    X, P = rows(1500, (100.0, 900.0), (0.0, 0.25))
    model = InverseModel(forget_rows=50, hidden=8, random_state=0, on_unreachable="clip").fit(X, P)
    far = X[(X["F"] > 700.0) & (X["eps"] > 0.18)]
    before = model.predict(far)
    for _ in range(20):  # in all more rows than the fit had, of one corner
        model.partial_fit(*rows(100, (100.0, 400.0), (0.0, 0.12)))
    assert np.sqrt(np.mean(np.square(model.predict(far) - before))) < 0.4 * np.std(before)

"""Empirical and hybrid force models: they recover what made the data, with units and intervals, and stay bounded."""

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import (
    GeometricForce,
    HosovskyHybrid,
    NonlinearElastic,
    Recurrent,
    ResidualHybrid,
    StaticForceMap,
    ThreeElement,
)

from pamid.bench.single import LiftSettings, festo_like, simulate_lift
from pamid.constants import ATMOSPHERIC_PRESSURE, GRAVITY
from pamid.errors import IncompatibleError, ParameterError, ShapeError, TimeOrderError, UnknownOptionError
from pamid.signals.state import State

L0 = 0.2
TRUTHS = {
    NonlinearElastic: {"contraction": 0.31, "c0": 400.0, "c1": 1.5e6, "c2": 0.35, "c3": 5e-9},
    StaticForceMap: {
        "area": 3e-4, "braid_angle": 0.45, "thread_compliance": 3e-8, "axial_stiffness": 150.0,
        "radial_stiffness": 40.0, "preload": -5.0,
    },
    HosovskyHybrid: {
        "a1": 2e-3, "a2": 40.0, "a3": -8.0, "a4": -1e-3, "a5": 3e-4, "a6": -20.0, "b0": 60.0, "b1": 1e-4,
    },
    ThreeElement: {
        "F0": 5.0, "K_fill0": 900.0, "B_fill0": 30.0, "K_vent0": 700.0, "B_vent0": 20.0,
        "F1": 700.0, "K_fill1": 9e3, "B_fill1": 90.0, "K_vent1": 8e3, "B_vent1": 50.0,
        "F2": 1500.0, "K_fill2": 2e4, "B_fill2": 150.0, "K_vent2": 1.7e4, "B_vent2": 80.0,
    },
}  # fmt: skip
each_model = pytest.mark.parametrize("cls", list(TRUTHS), ids=lambda c: c.__name__)


def table(n=800, seed=0):
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "eps": rng.uniform(0.0, 0.24, n),
            "deps": rng.normal(0, 0.3, n),
            "P": rng.uniform(1.1e5, 7e5, n),
            "dP": rng.normal(0, 3e5, n),
        }
    )


def made(cls, X):
    """Force that the true parameters give, through the estimator's own formula, which its example checks."""
    model = cls()
    state = State(*(X[c].to_numpy() for c in State._fields))
    model._prepare(state, np.ones(len(X)))
    return model._force(TRUTHS[cls], state)


@each_model
def test_parameters_come_back(cls):
    X = table()
    fit = cls().fit(X[list(cls().reads)], made(cls, X))
    for name, true in TRUTHS[cls].items():
        assert fit.parameters_[name] == pytest.approx(true, rel=1e-4, abs=1e-10), name
    assert set(fit.units_) == set(fit.parameters_) == set(fit.intervals_)
    assert all(fit.units_.values())


@each_model
def test_intervals_hold_the_truth(cls):
    """Of the 95 % intervals over many noises at least four fifths hold the truth, and not all are infinite."""
    X = table(400)
    clean = made(cls, X)
    noise = 0.02 * np.std(clean)
    held, finite = [], []
    for seed in range(12):
        y = clean + noise * np.random.default_rng(seed).normal(size=len(X))
        fit = cls().fit(X[list(cls().reads)], y)
        for name, true in TRUTHS[cls].items():
            low, high = fit.intervals_[name]
            finite.append(np.isfinite(high - low))
            held.append(low <= true <= high)
    assert np.mean(held) > 0.8
    assert np.mean(finite) > 0.6


@pytest.fixture(scope="module")
def lifts():
    return simulate_lift(loads=(20.0, 50.0, 90.0), every=40, settings=LiftSettings(frequency=0.25))


@each_model
def test_the_force_is_that_of_a_muscle(cls, lifts):
    """On the twin's single muscle the fitted force rises with pressure, falls with contraction, and is near."""
    log = lifts
    rates = log.groupby("trajectory", sort=False)[["eps", "P"]].transform(lambda s: np.gradient(s, 0.04))
    X = log[["trajectory", "eps", "P"]].assign(deps=rates["eps"], dP=rates["P"])
    rows = log["eps"] > 0.01  # not on its stand
    needs = list(cls().reads)
    fit = cls(**({"rest_length": L0} if "rest_length" in cls().get_params() else {})).fit(
        X.loc[rows, needs], log["F"][rows]
    )
    error = fit.predict(X.loc[rows, needs]) - log["F"][rows]
    assert np.sqrt(np.mean(error**2)) < 0.12 * np.ptp(log["F"])
    still = pd.DataFrame({"eps": 0.1, "deps": 0.0, "P": np.linspace(2.5e5, 5e5, 9), "dP": 0.0})
    assert (np.diff(fit.predict(still[needs])) > 0).all()
    bent = pd.DataFrame({"eps": np.linspace(0.05, 0.16, 9), "deps": 0.0, "P": 3.5e5, "dP": 0.0})
    assert (np.diff(fit.predict(bent[needs])) < 0).all()


def test_held_parameters_stay_and_unknown_ones_are_named():
    X = table()
    y = made(NonlinearElastic, X)
    fit = NonlinearElastic(fixed={"contraction": 0.31}).fit(X[["eps", "P"]], y)
    assert fit.parameters_["contraction"] == 0.31 and fit.standard_errors_["contraction"] == 0.0
    assert fit.parameters_["c0"] == pytest.approx(400.0, rel=1e-6)
    with pytest.raises(UnknownOptionError, match="c9"):
        NonlinearElastic(fixed={"c9": 1.0}).fit(X[["eps", "P"]], y)


def test_what_the_data_do_not_move_has_no_finite_interval():
    X = table().assign(deps=0.0)
    X["deps"] = 1e-18 * np.arange(len(X))  # what a filter leaves of rest
    fit = ThreeElement().fit(X, made(ThreeElement, X))
    assert fit.parameters_["B_fill1"] == 0.0
    assert np.isinf(fit.standard_errors_["B_fill1"]) and np.isfinite(fit.standard_errors_["K_fill1"])


# --- free runs ----------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def three_element():
    X = table()
    return ThreeElement().fit(X, made(ThreeElement, X))


def test_a_lift_comes_to_rest_where_the_forces_balance(three_element):
    t = np.arange(0, 12, 0.01)
    P = np.full(len(t), 4.5e5)
    run = three_element.simulate(t, P, load=60.0, start=0.0)
    assert not run.held.any() and not run.extrapolated.any()
    assert abs(run.F[-1] - 60 * GRAVITY) < 0.5
    assert abs(run.deps[-1]) < 1e-3
    from_rest = three_element.simulate(t, P, load=60.0)
    assert np.ptp(from_rest.eps) < 2e-3  # at a constant rate of pressure, zero, neither filling nor venting


def test_the_step_of_the_log_changes_little(three_element):
    fine, coarse = np.arange(0, 2, 0.002), np.arange(0, 2, 0.02)
    runs = [three_element.simulate(t, 3e5 + 1e5 * np.sin(6 * t), 40.0).eps for t in (fine, coarse)]
    assert np.abs(runs[0][::10][: len(runs[1])] - runs[1]).max() < 3e-3


def test_a_load_too_heavy_stays_on_its_stand(three_element):
    t = np.arange(0, 1, 0.01)
    run = three_element.simulate(t, np.full(len(t), 2e5), load=500.0)
    np.testing.assert_array_equal(run.eps, 0.0)


def test_an_unstable_or_unreached_run_is_held_and_flagged(three_element):
    t = np.arange(0, 2, 0.01)
    light = three_element.simulate(t, np.full(len(t), 7e5), load=0.5, start=0.2)
    top = three_element.eps_high_ + 0.1 * (three_element.eps_high_ - three_element.eps_low_)
    beyond = three_element.simulate(t, np.full(len(t), 3e6), load=40.0)
    assert beyond.extrapolated.all()
    runaway = ThreeElement(fixed={n: 0.0 for n in TRUTHS[ThreeElement] if n[0] in "KB"}).fit(
        table(), made(ThreeElement, table())
    )
    wild = runaway.simulate(t, np.full(len(t), 6e5), load=5.0)
    assert wild.held.any()
    for run in (light, beyond, wild):
        assert np.isfinite(run.eps).all() and run.eps.max() <= top + 1e-12 and run.eps.min() >= 0.0


def test_wrong_runs_are_refused(three_element):
    t = np.arange(0, 1, 0.1)
    with pytest.raises(ShapeError):
        three_element.simulate(t, np.full(3, 2e5), 10.0)
    with pytest.raises(TimeOrderError):
        three_element.simulate(t[::-1], np.full(10, 2e5), 10.0)
    with pytest.raises(ParameterError, match="load"):
        three_element.simulate(t, np.full(10, 2e5), -1.0)


# --- the hybrid ---------------------------------------------------------------------------------------------
def test_a_hybrid_takes_up_what_the_geometry_leaves_and_nothing_without_pressure():
    X = table()
    geometry = GeometricForce("chou_hannaford").fit(X[["eps", "P"]], made(StaticForceMap, X))
    y = geometry.predict(X[["eps", "P"]]) - 1e-4 * (X["P"] - ATMOSPHERIC_PRESSURE) * np.tanh(5 * X["deps"])
    hybrid = ResidualHybrid(GeometricForce("chou_hannaford"), random_state=0).fit(X, y)
    alone = GeometricForce("chou_hannaford").fit(X[["eps", "P"]], y).predict(X[["eps", "P"]])
    assert np.std(hybrid.predict(X) - y) < 0.1 * np.std(alone - y)
    at_rest = X.assign(P=ATMOSPHERIC_PRESSURE)
    np.testing.assert_allclose(hybrid.predict(at_rest), 0.0, atol=1e-9)
    assert hybrid.units_["rest_diameter"] == "m" and hybrid.standard_errors_["braid_angle"] > 0
    free = ResidualHybrid(GeometricForce("chou_hannaford"), vanishing=False, random_state=0).fit(X, y)
    assert np.abs(free.predict(at_rest)).max() > 0.1
    with pytest.raises(IncompatibleError, match="sequences"):
        ResidualHybrid(Recurrent()).fit(X, y)


def test_the_bench_of_the_tests_is_the_muscle_of_the_study():
    assert festo_like().muscle.rest_length == L0

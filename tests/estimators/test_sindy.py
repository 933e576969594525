"""Sparse regression and sparse dynamics: what is recovered, against PySINDy itself and against known laws."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pysindy
import pytest
import sklearn
from pamid.estimators import SINDyModel, SINDyRegressor
from sklearn.model_selection import GroupKFold, cross_validate

from pamid.errors import (
    DivergedError,
    FitError,
    MissingColumnError,
    MissingTrajectoryError,
    PamidWarning,
    ParameterError,
    SamplingError,
    ShapeError,
    ShortTrajectoryError,
    TimeOrderError,
    UnknownOptionError,
)


@pytest.fixture
def force_table():
    """A muscle's force by Chou and Hannaford's law, (P - P0)(a (1 - eps)² - b), with Coulomb friction of 8 N."""
    rng = np.random.default_rng(2)
    n = 600
    X = pd.DataFrame({"eps": rng.uniform(0, 0.25, n), "deps": rng.normal(0, 0.2, n), "P": rng.uniform(1.1e5, 7e5, n)})
    p = X["P"] - 101325.0
    return X, p * (2.4e-3 * (1 - X["eps"]) ** 2 - 8e-4) - 8.0 * np.sign(X["deps"])


def test_law_of_a_muscle_is_found(force_table):
    """With the sign of the rate in the library, every term of the law is found and no other."""
    X, y = force_table
    model = SINDyRegressor(("eps", "deps", "P"), degree=3, sign_of=("deps",), threshold=0.01, target="F").fit(X, y)
    a, b, p0 = 2.4e-3, 8e-4, 101325.0
    expected = {
        "1": -p0 * (a - b), "eps": 2 * a * p0, "P": a - b, "sign(deps)": -8.0, "eps^2": -a * p0, "eps P": -2 * a,
        "eps^2 P": a,
    }  # fmt: skip
    assert model.coefficients_ == pytest.approx(expected, rel=1e-6)
    assert model.equations_[0].startswith("F = ")
    assert model.score(X, y) > 1 - 1e-9


@pytest.mark.parametrize("optimizer", ["stlsq", "sr3", "frols"])
def test_optimizers_agree_on_a_clear_case(optimizer, force_table):
    X, _ = force_table
    y = 3e-3 * X["P"] - 3000.0 * X["eps"]
    alpha = 1e-9 if optimizer != "frols" else 0.0
    model = SINDyRegressor(("eps", "P"), degree=2, optimizer=optimizer, threshold=0.05, alpha=alpha, max_iter=30)
    kept = model.fit(X, y).coefficients_
    large = {term: c for term, c in kept.items() if abs(c) > 1e-7}
    assert {"eps", "P"} <= set(kept)
    assert large["eps"] == pytest.approx(-3000.0, rel=1e-3)
    assert large["P"] == pytest.approx(3e-3, rel=1e-3)


@pytest.mark.parametrize("optimizer", ["stlsq", "sr3"])
@pytest.mark.parametrize(("threshold", "kept"), [(0.05, ["eps", "P"]), (0.2, ["P"])])
def test_threshold_is_a_share_of_the_target(optimizer, threshold, kept):
    """A term of a tenth of the target's root mean square stays at a threshold of 0.05 and goes at one of 0.2."""
    rng = np.random.default_rng(4)
    X = pd.DataFrame({"eps": rng.normal(0, 0.1, 2000), "P": rng.normal(0, 1e5, 2000)})
    y = 0.995e-3 * X["P"] + 100.0 * X["eps"]  # root mean squares 99.5, 10 and 100
    model = SINDyRegressor(("eps", "P"), degree=1, bias=False, optimizer=optimizer, threshold=threshold, max_iter=200)
    assert list(model.fit(X, y).coefficients_) == kept


def test_instance_of_pysindy_serves_as_optimizer(force_table):
    """An optimizer object gives what its name gives, is left unfitted, and is not kept."""
    X, y = force_table
    optimizer = pysindy.STLSQ(threshold=0.02, alpha=1e-6)
    by_object = SINDyRegressor(("eps", "P"), optimizer=optimizer).fit(X, y)
    by_name = SINDyRegressor(("eps", "P")).fit(X, y)
    np.testing.assert_allclose(by_object.coef_, by_name.coef_)
    assert not hasattr(optimizer, "coef_")


def test_threshold_means_the_same_in_any_unit(force_table):
    """Pressure in bar instead of Pa, force in kN instead of N: the same terms are kept."""
    X, y = force_table
    one = SINDyRegressor(("eps", "P")).fit(X, y)
    other = SINDyRegressor(("eps", "P")).fit(X.assign(P=X["P"] / 1e5), y / 1e3)
    assert list(one.coefficients_) == list(other.coefficients_)
    np.testing.assert_allclose(other.predict(X.assign(P=X["P"] / 1e5)) * 1e3, one.predict(X), rtol=1e-9)


def test_agrees_with_pysindy(force_table):
    """On data that need no scaling the dynamics are those of PySINDy's own model."""
    t = np.arange(0, 6, 0.01)
    x = np.column_stack([np.cos(t), -np.sin(t)]) * np.sqrt(2)  # root mean square near one
    table = pd.DataFrame(x, columns=["q", "dq"])
    ours = SINDyModel(("q", "dq"), (), degree=2, threshold=0.2, sampling_period=0.01, one_trajectory=True).fit(table)
    theirs = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=0.2, alpha=1e-9),
        feature_library=pysindy.PolynomialLibrary(degree=2),
        differentiation_method=pysindy.SmoothedFiniteDifference(smoother_kws={"window_length": 11}),
    ).fit(x, t=0.01, feature_names=["q", "dq"])
    assert ours.terms_ == theirs.get_feature_names()
    np.testing.assert_allclose(ours.coef_, theirs.coefficients(), atol=1e-5)
    np.testing.assert_allclose(ours.predict(table), theirs.predict(x), atol=1e-5)


def joint(t, x, u):
    return [x[1], -40.0 * x[0] - 3.0 * x[1] + 25.0 * u]


@pytest.fixture
def joint_runs():
    """Three runs of a damped joint, driven by a sine each, at 200 Hz."""
    from scipy.integrate import solve_ivp

    runs = []
    for k, omega in enumerate((2.0, 4.0, 9.0)):
        t = np.arange(0, 4, 0.005)
        u = np.sin(omega * t)
        x = solve_ivp(lambda s, x, w=omega: joint(s, x, np.sin(w * s)), (0, 4), [0.2, 0.0], t_eval=t, rtol=1e-9).y
        runs.append(pd.DataFrame({"time": t, "q": x[0], "dq": x[1], "u": u, "trajectory": f"run-{k}"}))
    return pd.concat(runs, ignore_index=True)


def test_dynamics_of_a_joint(joint_runs):
    model = SINDyModel(("q", "dq"), ("u",), degree=2).fit(joint_runs)
    assert model.coefficients_["q"] == pytest.approx({"dq": 1.0}, rel=1e-3)
    assert model.coefficients_["dq"] == pytest.approx({"q": -40.0, "dq": -3.0, "u": 25.0}, rel=5e-3)
    assert model.score(joint_runs) > 0.999


def test_simulation_of_a_joint(joint_runs):
    """A run that was not fitted is followed in free run, from its initial state and its input alone."""
    fitted_on, unseen = joint_runs[joint_runs["trajectory"] != "run-2"], joint_runs[joint_runs["trajectory"] == "run-2"]
    model = SINDyModel(("q", "dq"), ("u",), degree=1).fit(fitted_on)
    x = model.simulate({"q": 0.2, "dq": 0.0}, unseen["time"], unseen)
    np.testing.assert_allclose(x, unseen[["q", "dq"]], atol=0.01 * np.abs(unseen["dq"]).max())
    by_function = model.simulate([0.2, 0.0], unseen["time"], lambda t: [np.sin(9.0 * t)])
    np.testing.assert_allclose(by_function, x, atol=2e-3)


def test_rates_do_not_cross_a_border(joint_runs):
    """Fitted with its neighbours, a run gives the rates that it gives alone."""
    model = SINDyModel(("q", "dq"), ("u",), degree=1).fit(joint_runs)
    together = model._rates(joint_runs, joint_runs.drop(columns="trajectory").to_numpy(), None)
    start = 0
    for _, run in joint_runs.groupby("trajectory"):
        alone = model._rates(run, run.drop(columns="trajectory").to_numpy(), None)
        np.testing.assert_array_equal(together[start : start + len(run)], alone)
        start += len(run)


def test_given_rates_need_no_trajectories(joint_runs):
    shuffled = joint_runs.sample(frac=1.0, random_state=0).drop(columns=["trajectory", "time"])
    rates = np.column_stack(joint(0, shuffled[["q", "dq"]].to_numpy().T, shuffled["u"].to_numpy()))
    model = SINDyModel(("q", "dq"), ("u",), degree=1).fit(shuffled, rates)
    assert model.coefficients_["dq"] == pytest.approx({"q": -40.0, "dq": -3.0, "u": 25.0}, rel=1e-6)


@pytest.mark.parametrize("routing", [False, True])
def test_cross_validation_of_dynamics(joint_runs, routing):
    """What PySINDy's own model can't: grouped folds with inputs, with routing off and on."""
    model = SINDyModel(("q", "dq"), ("u",), degree=1)
    groups = joint_runs["trajectory"]
    with sklearn.config_context(enable_metadata_routing=routing):
        told = {"params": {"groups": groups}} if routing else {"groups": groups}
        table = joint_runs.drop(columns="trajectory") if routing else joint_runs
        scores = cross_validate(model, table, cv=GroupKFold(3), error_score="raise", **told)["test_score"]
    assert (scores > 0.99).all()


BAD_FITS = {
    "unknown optimizer": ({"optimizer": "magic"}, UnknownOptionError, "stlsq"),
    "negative threshold": ({"threshold": -1.0}, ParameterError, "at least 0"),
    "degree of zero": ({"degree": 0}, ParameterError, "at least 1"),
    "sign of what is not read": ({"sign_of": ("q",)}, ParameterError, "sign_of"),
    "column that is not there": ({"inputs": ("eps", "mdot")}, MissingColumnError, "mdot"),
    "terms that depend on each other": (
        {"optimizer": "frols", "inputs": ("eps", "P"), "signals": {"P": "eps"}},
        FitError,
        "linearly independent",
    ),
}


@pytest.mark.parametrize("case", BAD_FITS)
def test_bad_parameters(case, force_table):
    changes, error, words = BAD_FITS[case]
    with pytest.raises(error, match=words):
        SINDyRegressor(("eps", "P")).set_params(**changes).fit(*force_table)


def test_threshold_that_removes_everything(force_table):
    X, y = force_table
    with pytest.warns(PamidWarning, match="kept no term"):
        model = SINDyRegressor(("eps", "P"), threshold=1e3).fit(X, y)
    assert model.equations_ == ["y = 0"]
    assert not model.predict(X).any()


def bad_runs(runs):
    one = {"one_trajectory": True}
    plain = runs[["q", "dq", "u"]]
    return {
        "no trajectories": (runs.drop(columns="trajectory"), {}, MissingTrajectoryError, "one_trajectory"),
        "no time": (plain, one, MissingColumnError, "time"),
        "no names and no time": (plain.to_numpy(), one, SamplingError, "sampling_period"),
        "time that stands still": (runs.assign(time=1.0), {}, TimeOrderError, "does not increase"),
        "negative period": (plain, {**one, "sampling_period": -1.0}, ParameterError, "sampling_period"),
        "short run": (runs.head(9), {}, ShortTrajectoryError, "9 rows"),
    }


@pytest.mark.parametrize("case", list(bad_runs(pd.DataFrame(columns=["time", "q", "dq", "u", "trajectory"]))))
def test_bad_runs(case, joint_runs):
    table, changes, error, words = bad_runs(joint_runs)[case]
    with pytest.raises(error, match=words):
        SINDyModel(("q", "dq"), ("u",)).set_params(**changes).fit(table)


def test_bad_simulations(joint_runs):
    model = SINDyModel(("q", "dq"), ("u",), degree=1).fit(joint_runs)
    t = np.linspace(0, 1, 11)
    with pytest.raises(ShapeError, match="x0 has 3 entries"):
        model.simulate([0, 0, 0], t, np.zeros((11, 1)))
    with pytest.raises(ShapeError, match="u has 0 rows"):
        model.simulate([0, 0], t)
    with pytest.raises(TimeOrderError):
        model.simulate([0, 0], t[::-1], np.zeros((11, 1)))
    with pytest.raises(ShapeError, match="rates of 2 states"):
        SINDyModel(("q", "dq"), ("u",)).fit(joint_runs, np.zeros(len(joint_runs)))


def test_simulation_that_runs_away():
    """x' = x² leaves every bound at t = 1; the answer is an error, not a number."""
    x = np.linspace(0.5, 3.0, 200)
    model = SINDyModel(("x",), (), degree=2).fit(pd.DataFrame({"x": x}), x**2)
    with pytest.raises(DivergedError, match="t = "):
        model.simulate([1.0], np.linspace(0, 2, 50))

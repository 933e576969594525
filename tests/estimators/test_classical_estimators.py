"""Geometric and polynomial estimators: they recover what made the data, and say how well they know it."""

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GeometricFlow, GeometricForce, PolynomialFlow, PolynomialForce

from pamid.errors import (
    ExcitationWarning,
    IncompatibleError,
    ParameterError,
    ShapeError,
    UnitWarning,
    UnknownOptionError,
    VolumeWarning,
)
from pamid.signals.state import State
from pamid.volume.bou_saba import BouSabaVolume
from pamid.volume.braided import BraidedVolume
from pamid.volume.functions import flow, force
from pamid.volume.polynomial import PolynomialVolume
from pamid.volume.tondu_lopez import TonduLopezVolume, braid_friction

TRUTHS = {
    "chou_hannaford": BraidedVolume(0.25, 0.018, 0.47),
    "tondu_lopez": TonduLopezVolume(0.25, 0.018, 0.47, end_cap=1.12),
    "bou_saba": BouSabaVolume(0.25, 0.018, 0.47, exponent=2.3),
}


def table(n=400, seed=0):
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "dP": rng.normal(0, 1e6, n),
            "eps": rng.uniform(0.0, 0.24, n),
            "P": rng.uniform(1.3e5, 6.5e5, n),
            "deps": rng.normal(0, 0.5, n),
        }
    )


def state(X):
    return State(*(X[c].to_numpy() for c in State._fields))


def force_of(volume, X):
    return force(volume, X.P.to_numpy(), X.eps.to_numpy())


def flow_of(volume, X):
    return flow(volume, *(X[c].to_numpy() for c in ("P", "dP", "eps", "deps")))


def made(equation, volume, X, noise=0.0, seed=1):
    y = force_of(volume, X) if equation == "force" else flow_of(volume, X)
    return y + noise * np.std(y) * np.random.default_rng(seed).normal(size=len(y))


GEOMETRIC = {"force": GeometricForce, "flow": GeometricFlow}


@pytest.mark.parametrize("equation", GEOMETRIC)
@pytest.mark.parametrize("model", TRUTHS)
def test_a_geometric_fit_recovers_the_parameters(equation, model):
    X, truth = table(), TRUTHS[model]
    y = made(equation, truth, X)
    fit = GEOMETRIC[equation](model, rest_length=0.25, rest_diameter=0.03, braid_angle=0.6).fit(X, y)
    for name, value in fit.parameters_.items():
        assert value == pytest.approx(getattr(truth, name), rel=1e-6), name
        assert fit.units_[name]
    np.testing.assert_allclose(fit.predict(X), y, rtol=1e-6, atol=1e-9 * np.abs(y).max())
    for a, b in zip(fit.volume(X), truth.jet(state(X)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-15)
    assert fit.standard_errors_["rest_length"] == 0.0


@pytest.mark.parametrize("equation", GEOMETRIC)
def test_standard_errors_are_the_spread_over_repeated_noise(equation):
    X, truth = table(200), TRUTHS["chou_hannaford"]
    fits = [GEOMETRIC[equation](rest_length=0.25).fit(X, made(equation, truth, X, 0.05, 100 + s)) for s in range(60)]
    for name in ("rest_diameter", "braid_angle"):
        values = np.array([f.parameters_[name] for f in fits])
        claimed = np.mean([f.standard_errors_[name] for f in fits])
        assert 0.75 < values.std() / claimed < 1.35
        assert abs(values.mean() - getattr(truth, name)) < 4 * claimed / np.sqrt(60)


@pytest.mark.parametrize("equation", GEOMETRIC)
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_model_never_ends_worse_than_the_one_it_contains(equation, noise):
    X = table()
    y = made(equation, TRUTHS["bou_saba"], X, noise) + made(equation, TRUTHS["tondu_lopez"], X) ** 2 * 1e-3

    def rss(model):
        return np.sum((GEOMETRIC[equation](model, rest_length=0.25).fit(X, y).predict(X) - y) ** 2)

    plain = rss("chou_hannaford")
    assert rss("tondu_lopez") <= plain * (1 + 1e-9)
    assert rss("bou_saba") <= plain * (1 + 1e-9)


def test_friction_is_identified_with_the_geometry():
    X, truth = table(1000), TRUTHS["tondu_lopez"]
    numbers = {"static_friction_area": 4e-5, "kinetic_friction_area": 2e-5, "stribeck_rate": 0.3}
    X["F"] = force_of(truth, X) - braid_friction(X.deps.to_numpy(), X.P.to_numpy() - 101325.0, **numbers)
    free = ["rest_diameter", "braid_angle", "end_cap", *numbers]
    fit = GeometricForce("tondu_lopez", rest_length=0.25, friction=True, free=free).fit(X.drop(columns="F"), X.F)
    for name, value in numbers.items():
        assert fit.parameters_[name] == pytest.approx(value, rel=1e-5)
    without = GeometricForce("tondu_lopez", rest_length=0.25).fit(X, X.F)
    assert np.std(without.predict(X) - X.F) > 1.0  # N: the loop that no volume explains


def test_what_the_data_do_not_tell_has_an_infinite_standard_error():
    X = table()
    y = made("flow", TRUTHS["chou_hannaford"], X, 0.01)
    fit = GeometricFlow(rest_length=0.25, free="all").fit(X, y)  # D₀² L₀ is one number
    assert np.isinf(fit.standard_errors_["rest_length"])
    assert np.isinf(fit.standard_errors_["rest_diameter"])
    assert np.isfinite(fit.standard_errors_["braid_angle"])
    still = X.assign(eps=0.1)
    with pytest.warns(ExcitationWarning, match="eps hardly varies"):
        fit = GeometricForce(rest_length=0.25).fit(still, force_of(TRUTHS["chou_hannaford"], still))
    assert np.isinf(fit.standard_errors_["rest_diameter"])


def test_a_parameter_on_its_bound_says_so():
    X = table()
    y = made("force", TRUTHS["chou_hannaford"], X, 0.01)
    fit = GeometricForce(rest_length=0.25, bounds={"rest_diameter": (0.019, 0.03)}).fit(X, y)
    assert fit.at_bound_ == ["rest_diameter"]
    assert fit.parameters_["rest_diameter"] == pytest.approx(0.019)
    assert np.isinf(fit.standard_errors_["rest_diameter"])
    held = GeometricForce(rest_length=0.25, rest_diameter=0.018, free=["braid_angle"]).fit(X, y)
    assert held.parameters_["rest_diameter"] == 0.018
    assert held.fitted_names_ == ["braid_angle"]
    assert held.covariance_.shape == (1, 1)
    nothing = GeometricForce(rest_length=0.25, rest_diameter=0.018, braid_angle=0.47, free=[]).fit(X, y)
    np.testing.assert_allclose(nothing.predict(X), force_of(TRUTHS["chou_hannaford"], X), rtol=1e-9)


ALL = [
    (GeometricForce("tondu_lopez", rest_length=0.25), "force"),
    (GeometricFlow(rest_length=0.25), "flow"),
    (PolynomialForce(3), "force"),
    (PolynomialForce(2, "surface"), "force"),
    (PolynomialFlow(3, 1), "flow"),
]


@pytest.mark.parametrize(("estimator", "equation"), ALL)
def test_a_weight_of_two_is_the_row_twice(estimator, equation):
    X = table(120)
    y = made(equation, TRUTHS["bou_saba"], X, 0.1)
    weight = np.random.default_rng(3).integers(0, 4, len(X))
    rows = np.repeat(np.arange(len(X)), weight)
    a = estimator.fit(X, y, sample_weight=weight)
    prediction, errors = a.predict(X), dict(a.standard_errors_)
    b = estimator.fit(X.iloc[rows], y[rows])
    np.testing.assert_allclose(prediction, b.predict(X), rtol=1e-7, atol=1e-7 * np.abs(y).max())
    for name, value in b.standard_errors_.items():
        assert errors[name] == pytest.approx(value, rel=1e-3)


@pytest.mark.parametrize(("estimator", "equation"), ALL)
def test_groups_change_the_standard_errors_alone(estimator, equation):
    """Sixty copies of one sample in each trajectory are one sample: the plain errors are √60 too small."""
    X = table(60)
    y = made(equation, TRUTHS["chou_hannaford"], X, 0.1)
    rows = np.repeat(np.arange(60), 60)
    once = dict(estimator.fit(X, y).standard_errors_)
    X, y, groups = X.iloc[rows].reset_index(drop=True), y[rows], np.array([f"run {i}" for i in rows])
    plain = estimator.fit(X, y)
    prediction, small = plain.predict(X), dict(plain.standard_errors_)
    robust = estimator.fit(X, y, groups=groups)
    np.testing.assert_array_equal(prediction, robust.predict(X))
    known = [n for n, s in small.items() if 0 < s < np.inf]
    assert known
    for name in known:
        assert 0.5 < robust.standard_errors_[name] / once[name] < 2.0
        assert robust.standard_errors_[name] > 3.0 * small[name]
    assert all(np.isinf(e) for e in estimator.fit(X, y, groups=np.zeros(len(X))).covariance_.diagonal())


# --- polynomials --------------------------------------------------------------------------------------------
def test_polynomials_recover_a_polynomial():
    X, truth = table(), BraidedVolume(0.25, 0.018, 0.47)
    area = PolynomialForce(2, rest_length=0.25, rest_volume=np.pi * 0.018**2 / 4 * 0.25).fit(X, force_of(truth, X))
    cubic = PolynomialFlow(3).fit(X, flow_of(truth, X))
    for fit in (area, cubic):
        for a, b in zip(fit.volume(X), truth.jet(state(X)), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-15)
    expected = PolynomialVolume.from_geometry(0.25, 0.018, 0.47).coefficients
    np.testing.assert_allclose(list(cubic.parameters_.values()), expected, rtol=1e-8)


def test_a_volume_that_swells_with_pressure_is_recovered():
    X = table()
    eps, deps, P, dP = state(X)
    RT = 287.0 * 293.0
    V = 6e-5 + 4e-4 * eps + 5e-11 * P + 1e-10 * eps * P
    V_eps, V_P = 4e-4 + 1e-10 * P, 5e-11 + 1e-10 * eps
    fit = PolynomialFlow(1, 1).fit(X, dP * V / 1.4 / RT + P * (V_eps * deps + V_P * dP) / RT)
    np.testing.assert_allclose(fit.coef_, [6e-5, 4e-4, 5e-11, 1e-10], rtol=1e-7)
    assert list(fit.units_.values()) == ["m³", "m³", "m³/Pa", "m³/Pa"]
    for a, b in zip(fit.volume(X), (V, V_eps, V_P), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-7)


def test_the_surface_takes_up_an_elastic_force_and_the_area_cannot():
    X = table()
    y = force_of(TRUTHS["chou_hannaford"], X) - 300.0 * X.eps.to_numpy() + 5.0
    surface = PolynomialForce(3, "surface").fit(X, y)
    assert np.abs(surface.predict(X) - y).max() < 1e-6
    assert surface.parameters_["c00"] == pytest.approx(5.0, abs=1e-6)
    assert np.abs(PolynomialForce(3).fit(X, y).predict(X) - y).max() > 5.0
    with pytest.raises(IncompatibleError, match="form='area'"):
        surface.volume(X)
    at_rest = X.assign(P=101325.0)
    assert np.all(PolynomialForce(3).fit(X, y).predict(at_rest) == 0.0)


@pytest.mark.parametrize("estimator", [PolynomialForce(3), PolynomialForce(2, "surface"), PolynomialFlow(3, 1)])
def test_batches_equal_one_fit_on_all_rows(estimator):
    X = table(1000)
    y = made("flow" if isinstance(estimator, PolynomialFlow) else "force", TRUTHS["bou_saba"], X, 0.1)
    weight = np.random.default_rng(0).uniform(0, 2, 1000)
    estimator.fit(X, y, sample_weight=weight)
    coef, errors = estimator.coef_, list(estimator.standard_errors_.values())
    batches = type(estimator)(**estimator.get_params())
    for rows in np.split(np.arange(1000), [1, 7, 300, 301, 900]):
        batches.partial_fit(X.iloc[rows], y[rows], sample_weight=weight[rows])
    np.testing.assert_allclose(batches.coef_, coef, rtol=1e-7)
    np.testing.assert_allclose(list(batches.standard_errors_.values()), errors, rtol=1e-7)
    assert batches.factor_.shape[0] <= len(coef) + 1
    batches.fit(X.iloc[:500], y[:500])  # fit starts over
    np.testing.assert_allclose(batches.coef_, type(estimator)(**estimator.get_params()).fit(X[:500], y[:500]).coef_)


def test_memory_of_a_long_log_is_compressed_in_chunks(monkeypatch):
    from pamid.estimators import _linear

    X = table(1000)
    y = made("force", TRUTHS["bou_saba"], X, 0.1)
    whole = PolynomialForce(3).fit(X, y).coef_
    monkeypatch.setattr(_linear, "CHUNK", 17)
    np.testing.assert_allclose(PolynomialForce(3).fit(X, y).coef_, whole, rtol=1e-9)


# --- what goes wrong ----------------------------------------------------------------------------------------
def test_signals_are_found_by_name_or_position():
    X = table()
    y = made("force", TRUTHS["chou_hannaford"], X)
    by_name = GeometricForce(rest_length=0.25).fit(X, y)
    by_position = GeometricForce(rest_length=0.25).fit(X[["eps", "P"]].to_numpy(), y)
    assert by_name.parameters_ == by_position.parameters_
    mapped = GeometricForce(rest_length=0.25, signals={"eps": "contraction"})
    assert mapped.fit(X.rename(columns={"eps": "contraction"}), y).parameters_ == by_name.parameters_
    with pytest.raises(ShapeError, match="eps, deps, P"):
        GeometricForce(friction=True).fit(X[["eps", "P"]].to_numpy(), y)


def test_wrong_units_are_told_before_the_fit():
    X = table()
    y = made("force", TRUTHS["chou_hannaford"], X)
    with pytest.warns(UnitWarning, match="percent"):
        GeometricForce(rest_length=0.25).fit(X.assign(eps=100 * X.eps), y)
    with pytest.warns(UnitWarning, match="bar"):
        PolynomialForce().fit(X.assign(P=X.P / 1e5), y)


def test_a_senseless_volume_is_told_when_it_is_asked_for():
    X = table()
    fit = PolynomialFlow(2).fit(X, -made("flow", TRUTHS["chou_hannaford"], X))
    with pytest.warns(VolumeWarning, match="not positive"):
        fit.volume(X)


@pytest.mark.parametrize(
    ("estimator", "error", "words"),
    [
        (GeometricForce("mckibben"), UnknownOptionError, "chou_hannaford"),
        (GeometricForce("polynomial"), UnknownOptionError, "tondu_lopez"),
        (GeometricForce(rest_diameter=-0.02), ParameterError, "rest_diameter is -0.02"),
        (GeometricForce(free="some"), UnknownOptionError, "'auto', 'all' or a list"),
        (GeometricForce(free=["end_cap"]), UnknownOptionError, "does not have"),
        (GeometricForce(start={"exponent": 2.0}), UnknownOptionError, "start names exponent"),
        (GeometricForce(bounds={"braid_angle": (1.0, 0.1)}), ParameterError, "lower bound below the upper"),
        (PolynomialForce(-1), ParameterError, "integer from 0"),
        (PolynomialForce(2.5), ParameterError, "2.5"),
        (PolynomialForce(2, "cubic"), UnknownOptionError, "'area' or 'surface'"),
    ],
)
def test_a_wrong_parameter_is_told_at_fit(estimator, error, words):
    X = table(30)
    with pytest.raises(error, match=words):
        estimator.fit(X, made("force", TRUTHS["chou_hannaford"], X))


def test_ambient_pressure_is_the_users():
    """At altitude the same absolute pressure pulls harder; the end caps feel the gauge pressure, too."""
    X = table()
    muscle = TonduLopezVolume(0.25, 0.018, 0.47, end_cap=1.1, end_cap_rise=0.5, atmospheric_pressure=80_000.0)
    y = force(muscle, X.P.to_numpy(), X.eps.to_numpy(), atmospheric_pressure=80_000.0)
    fit = GeometricForce("tondu_lopez", rest_length=0.25, free="all", atmospheric_pressure=80_000.0).fit(X, y)
    assert fit.parameters_["end_cap_rise"] == pytest.approx(0.5, rel=1e-5)

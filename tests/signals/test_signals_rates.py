"""Rates: right where the derivative is known, tuned near the best, within trajectories, for every method alike."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
import sklearn
from hypothesis import given, settings
from hypothesis import strategies as st
from pamid.estimators import RateTransformer
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, cross_validate
from sklearn.pipeline import Pipeline

from pamid import errors
from pamid.signals import TrajectoryKFold, differentiate, noise_level, tune_cutoff
from pamid.signals import kalman as kalman_module
from pamid.signals import spline as spline_module
from pamid.signals.driven import fit_gains, held_integral
from pamid.signals.noise import quantisation_step
from pamid.signals.rates import METHODS, _method

each_method = pytest.mark.parametrize("method", METHODS)


def nrmse(rate: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean((rate - truth) ** 2)) / truth.std())


def noisy_sine(omega: float = 5.0, noise: float = 1e-3, n: int = 4000, period: float = 1e-3, seed: int = 0):
    t = period * np.arange(n)
    z = np.sin(omega * t) + noise * np.random.default_rng(seed).standard_normal(n)
    return t, z, omega * np.cos(omega * t), -(omega**2) * np.sin(omega * t)


# --- right ----------------------------------------------------------------------------------------------------
@each_method
def test_noisy_sine(method):
    """Far below the error of plain differences, and the second rate is usable too."""
    t, z, rate, second = noisy_sine()
    _, got, got2 = differentiate(z, t, method=method, second=True)
    assert nrmse(got, rate) < 0.01
    assert nrmse(got, rate) < 0.05 * nrmse(np.gradient(z, t), rate)
    assert nrmse(got2[200:-200], second[200:-200]) < 0.1


@each_method
@given(
    coefficients=st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    n=st.integers(8, 200),
    cutoff=st.floats(0.02, 0.4),
    scale=st.sampled_from([1e-6, 1.0, 1e6]),
)
@settings(deadline=None, max_examples=25)
def test_polynomials_are_exact(method, coefficients, n, cutoff, scale):
    """Straight lines come out exactly everywhere, at any cut-off, parabolas where the method promises them."""
    x = np.arange(n) / n
    degree = 3 if method == "savgol" else 2
    c = np.array(coefficients[:degree]) * scale
    y, truth = np.polyval(c[::-1], x), np.polyval(np.polyder(c[::-1]), x)
    value, rate = differentiate(y, sampling_period=1 / n, method=method, tuning=cutoff * n)
    tolerance = 1e-6 * np.abs(c).max() + 1e-300
    assert value == pytest.approx(y, abs=tolerance)
    assert rate == pytest.approx(truth, abs=tolerance * n)


@each_method
@pytest.mark.parametrize("n", [2, 3, 5, 7, 8, 9, 15, 50])
def test_few_samples(method, n):
    t = 0.01 * np.arange(n)
    smoothed, rate = differentiate(3 + 2 * t, t, method=method)
    assert smoothed == pytest.approx(3 + 2 * t)
    assert rate == pytest.approx(np.full(n, 2.0), abs=1e-5)


@each_method
def test_ends_are_no_worse_than_their_one_sided_neighbourhood(method):
    """At the ends the error grows, but stays far below that of differences over the same noise."""
    errors_at_ends, errors_of_differences = [], []
    for seed in range(20):
        t, z, rate, _ = noisy_sine(noise=1e-2, seed=seed, n=2000)
        got = differentiate(z, t, method=method)[1]
        errors_at_ends += [got[0] - rate[0], got[-1] - rate[-1]]
        errors_of_differences += [(z[1] - z[0]) / 1e-3 - rate[0]]
    assert np.std(errors_at_ends) < 0.1 * np.std(errors_of_differences)


@each_method
@pytest.mark.parametrize(("omega", "noise"), [(1.0, 1e-3), (10.0, 1e-2), (30.0, 1e-4)])
def test_automatic_tuning_is_near_the_best(method, omega, noise):
    """The cut-off that knows nothing of the truth costs a small factor of the error at most."""
    t, z, rate, _ = noisy_sine(omega, noise)
    automatic = nrmse(differentiate(z, t, method=method)[1], rate)
    best = min(
        nrmse(differentiate(z, t, method=method, tuning=c)[1], rate) for c in np.geomspace(omega / 20, 50 * omega, 40)
    )
    assert automatic < 2.5 * best


@each_method
def test_quantised_signal(method):
    """A noiseless encoder of 14 bit: the steps are told from the signal."""
    t = 1e-3 * np.arange(8000)
    step = 2 * np.pi / 2**14
    z = np.round(0.35 * np.sin(t) / step) * step
    assert quantisation_step(z) == pytest.approx(step)
    assert noise_level(z) >= step / np.sqrt(12) * (1 - 1e-9)
    assert nrmse(differentiate(z, t, method=method)[1], 0.35 * np.cos(t)) < 0.005


def test_noise_level_sees_noise_and_not_the_signal():
    rng = np.random.default_rng(0)
    t = np.arange(5000) * 1e-3
    steps = np.where(t > 2, 1.0, 0.0)
    assert noise_level(np.sin(10 * t) + steps + 0.003 * rng.standard_normal(t.size)) == pytest.approx(0.003, rel=0.05)
    assert noise_level(np.zeros(100)) == 0.0
    assert quantisation_step(rng.standard_normal(1000)) == 0.0


@each_method
def test_gain_describes_the_method(method):
    """The gain that tuning reckons with is the gain a sine meets, and 1/√2 at the cut-off."""
    module, n = _method(method), 6000
    for omega in (0.02, 0.06, 0.1):
        k = np.arange(n)
        rate = differentiate(np.sin(omega * k), sampling_period=1.0, method=method, tuning=0.01)[1]
        middle = slice(2000, 4000)
        met = 2 * np.mean(rate[middle] * np.cos(omega * k[middle])) / omega
        assert met == pytest.approx(float(module.gain(np.array([omega]), 0.01)[0]), abs=0.03)
    if method != "savgol":
        assert module.gain(np.array([2 * np.pi * 0.01]), 0.01)[0] == pytest.approx(np.sqrt(0.5), abs=0.01)


# --- Kalman ---------------------------------------------------------------------------------------------------
def test_filterpy_measures_one_signal():
    """H is (1, 3) and measures the value alone, in every version of filterpy."""
    kf = kalman_module.filterpy_filter(kalman_module.model(0.02), np.eye(3))
    np.testing.assert_array_equal(kf.H, [[1.0, 0.0, 0.0]])
    w = 2 * np.pi * 0.02
    np.testing.assert_allclose(kf.F, [[1, w, w**2 / 2], [0, 1, w], [0, 0, 1]])
    assert np.linalg.eigvalsh(kf.Q).min() > 0


@pytest.mark.parametrize("cutoff", [0.005, 0.05])
def test_steady_gain_is_where_filterpy_ends(cutoff):
    """The Riccati gain is the one that filterpy's recursion converges to, and the fast smoother agrees with it."""
    m, gains = kalman_module.model(cutoff), kalman_module.steady(cutoff)
    rng = np.random.default_rng(0)
    y = np.cumsum(rng.standard_normal(1200)) / 30
    kf = kalman_module.filterpy_filter(m, 1e6 * np.eye(3))
    kf.x = np.array([[y[0]], [0.0], [0.0]])
    means, covariances, _, _ = kf.batch_filter(y[:, None, None], update_first=True)
    np.testing.assert_allclose(kf.K[:, 0], gains.K, rtol=1e-6)
    np.testing.assert_allclose(covariances[-1], gains.P, rtol=1e-6, atol=1e-12)
    exact = kf.rts_smoother(means, covariances)[0][:, :, 0]
    spread = y.std()
    value, rate, second = kalman_module.smooth(y[:, None], cutoff)
    np.testing.assert_allclose(value[:, 0], exact[:, 0], atol=2e-3 * spread)
    np.testing.assert_allclose(rate[:, 0], exact[:, 1] * m.omega, atol=2e-3 * spread * m.omega)
    np.testing.assert_allclose(second[:, 0], exact[:, 2] * m.omega**2, atol=5e-3 * spread * m.omega**2)


def test_spline_without_relaxed_ends_is_scipys(monkeypatch):
    """Without the functions at the ends the spline is the natural smoothing spline of scipy."""
    from scipy.interpolate import make_smoothing_spline

    monkeypatch.setattr(spline_module, "_end_functions", lambda t, cutoff: None)
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.5, 1.5, 80))
    y = np.sin(t / 8) + 0.1 * rng.standard_normal(80)
    value, rate, second = spline_module.smooth(y[:, None], 0.05, t)
    oracle = make_smoothing_spline(t, y, lam=spline_module.smoothing(0.05))
    np.testing.assert_allclose(value[:, 0], oracle(t), atol=1e-9)
    np.testing.assert_allclose(rate[:, 0], oracle.derivative()(t), atol=1e-9)
    np.testing.assert_allclose(second[1:-1, 0], oracle.derivative(2)(t)[1:-1], atol=1e-8)


# --- time -----------------------------------------------------------------------------------------------------
@each_method
def test_unequal_steps(method):
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.choice([1e-3, 2e-3, 3e-3], p=[0.2, 0.6, 0.2], size=4000))
    z = np.sin(5 * t) + 1e-3 * rng.standard_normal(t.size)
    with pytest.warns(errors.SamplingWarning, match="of the steps differ"):
        smoothed, rate = differentiate(z, t, method=method)
    assert len(rate) == len(t)
    assert nrmse(rate, 5 * np.cos(5 * t)) < 0.02
    assert nrmse(smoothed, np.sin(5 * t)) < 0.002


@each_method
def test_gap(method):
    t = np.concatenate([np.arange(0, 1, 1e-3), np.arange(1.5, 2.5, 1e-3)])
    with pytest.warns(errors.SamplingWarning, match=r"longest step is 0\.501 s"):
        rate = differentiate(np.sin(3 * t), t, method=method)[1]
    assert nrmse(rate[:900], 3 * np.cos(3 * t[:900])) < 0.05


@each_method
@given(shift=st.floats(-1e4, 1e4), factor=st.sampled_from([1e-3, 0.5, 2.0, 1e3]), offset=st.floats(-1e3, 1e3))
@settings(deadline=None, max_examples=10)
def test_rates_do_not_depend_on_units_or_origin(method, shift, factor, offset):
    """A signal in other units gives its rate in these units; the clock's and the signal's origin do not matter."""
    t, z, _, _ = noisy_sine(n=500)
    rate = differentiate(z, t, method=method, tuning=20.0)[1]
    other = differentiate(factor * z + offset, t + shift, method=method, tuning=20.0)[1]
    np.testing.assert_allclose(other / factor, rate, atol=1e-4 * (1 + abs(offset) / factor * 1e-7))


@each_method
def test_channels_are_independent(method):
    t, z, _, _ = noisy_sine()
    both = differentiate(np.stack([z, 1e5 * np.cos(t)], axis=1), t, method=method)
    for k in range(2):
        np.testing.assert_allclose(both[k][:, 0], differentiate(z, t, method=method)[k])
    with_two = differentiate(np.stack([z, z], axis=1), t, method=method, tuning=[5.0, 50.0])[1]
    np.testing.assert_allclose(with_two[:, 1], differentiate(z, t, method=method, tuning=50.0)[1])


@each_method
@pytest.mark.filterwarnings("ignore::pamid.errors.SamplingWarning")
@given(
    n=st.integers(2, 60),
    channels=st.integers(1, 3),
    seed=st.integers(0, 1000),
    uneven=st.booleans(),
    second=st.booleans(),
)
@settings(deadline=None, max_examples=25)
def test_shapes(method, n, channels, seed, uneven, second):
    """Whatever the length, results are finite and of the shape of y."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.5, 1.5, n)) if uneven else np.arange(n, dtype=float)
    results = differentiate(rng.standard_normal((n, channels)), 1e-3 * t, method=method, second=second)
    assert len(results) == 2 + second
    assert all(r.shape == (n, channels) and np.isfinite(r).all() for r in results)


@each_method
@pytest.mark.parametrize("value", [0.0, 1e5, -3.0])
def test_constants_have_no_rate(method, value):
    smoothed, rate = differentiate(np.full(300, value), sampling_period=1e-3, method=method)
    np.testing.assert_allclose(smoothed, value, rtol=1e-9)
    np.testing.assert_allclose(rate, 0, atol=1e-6 * max(abs(value), 1))


@each_method
def test_a_million_rows_are_smoothed_in_one_go(method):
    t = np.arange(1_000_000) * 1e-3
    z = np.sin(t) + 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    assert nrmse(differentiate(z, t, method=method)[1], np.cos(t)) < 0.003


@pytest.mark.parametrize(
    ("arguments", "options", "expected", "words"),
    [
        (([1.0], [0.0]), {}, errors.ShortTrajectoryError, "1 sample"),
        (([1.0, np.nan, 2.0], [0, 1, 2]), {}, errors.NonFiniteError, "row 2"),
        (([1.0, 2.0, 3.0], [0, 1, np.inf]), {}, errors.NonFiniteError, "time"),
        (([1.0, 2.0, 3.0], [0, 2, 1]), {}, errors.TimeOrderError, "row 3"),
        (([1.0, 2.0, 3.0], [0, 1, 1]), {}, errors.TimeOrderError, "does not increase"),
        (([1.0, 2.0, 3.0], [0, 1]), {}, errors.ShapeError, "2 entries for 3"),
        (([1.0, 2.0],), {}, errors.ParameterError, "Neither t nor sampling_period"),
        (([1.0, 2.0],), {"sampling_period": 0.0}, errors.ParameterError, "sampling_period is 0"),
        ((np.zeros((2, 2, 2)), [0, 1]), {}, errors.ShapeError, "3 dimensions"),
        (([1.0, 2.0], [0, 1]), {"method": "wavelet"}, errors.UnknownOptionError, "wavelet"),
        ((np.zeros(20), np.arange(20)), {"tuning": "best"}, errors.UnknownOptionError, "best"),
        ((np.zeros(20), np.arange(20)), {"tuning": -1.0}, errors.ParameterError, "positive cut-off"),
        ((np.zeros(20), np.arange(20)), {"tuning": [1.0, 2.0]}, errors.ParameterError, "each of 1 channels"),
        ((np.zeros(9), np.array([*range(8), 1e6])), {}, errors.SamplingError, "sampling periods"),
    ],
)
def test_bad_input(arguments, options, expected, words):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(expected, match=words):
            differentiate(*arguments, **options)


# --- the transformer ------------------------------------------------------------------------------------------
@pytest.fixture
def log() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    parts = []
    for number, name in enumerate(["sine-1", "sine-2", "step-1", "step-2"]):
        t = 1e-2 * np.arange(150 + 10 * number)
        eps = 0.1 * np.sin((2 + number) * t) + 1e-4 * rng.standard_normal(t.size)
        P = 3e5 + 5e4 * np.cos((1 + number) * t) + 50 * rng.standard_normal(t.size)
        parts.append(pd.DataFrame({"trajectory": name, "time": t, "eps": eps, "P": P}))
    return pd.concat(parts, ignore_index=True)


@each_method
def test_rates_never_cross_borders(log, method):
    """A trajectory's rates are those it has alone, whatever stands before or after it."""
    rates = RateTransformer(method=method, tuning=[4.0, 5.0])
    together = rates.fit_transform(log)
    for name, rows in log.groupby("trajectory"):
        alone = rates.transform(rows)
        pd.testing.assert_frame_equal(together[together["trajectory"] == name], alone)
    swapped = pd.concat([log[log["trajectory"] == n] for n in reversed(list(log["trajectory"].unique()))])
    pd.testing.assert_frame_equal(rates.transform(swapped).sort_index(), together)


def test_frames_keep_rows_names_and_index(log):
    log.index = log.index * 3 + 1
    out = RateTransformer(smooth=True, second=True).fit_transform(log)
    assert list(out.columns) == ["trajectory", "time", "eps", "P", "deps", "dP", "ddeps", "ddP"]
    assert out.index.equals(log.index)
    assert out["trajectory"].equals(log["trajectory"])
    assert 0 < np.std(out["eps"] - log["eps"]) < 3e-4
    assert "deps" not in log.columns


def test_arrays_with_groups_give_the_same(log):
    codes = log["trajectory"].to_numpy()
    array = log[["time", "eps", "P"]].to_numpy()
    rates = RateTransformer(columns=[1, 2], time=0)
    out = rates.fit_transform(array, groups=codes)
    frame = RateTransformer().fit_transform(log)
    np.testing.assert_allclose(out[:, 3:], frame[["deps", "dP"]].to_numpy())
    assert list(rates.get_feature_names_out(["t", "e", "p"])) == ["t", "e", "p", "de", "dp"]
    as_frame = RateTransformer(columns=[1, 2], time=0).set_output(transform="pandas").fit_transform(array, groups=codes)
    assert list(as_frame.columns) == ["x0", "x1", "x2", "dx1", "dx2"]


def test_one_warning_for_all_trajectories(log):
    rng = np.random.default_rng(0)
    log["time"] += rng.uniform(0, 0.009, len(log))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        RateTransformer().fit_transform(log)
    assert len(caught) == 1
    assert str(caught[0].message).startswith("4 of 4 runs are not sampled evenly.")


def test_tuning_is_learnt_once_over_all_trajectories(log):
    rates = RateTransformer().fit(log)
    assert rates.cutoffs_.shape == (2,)
    assert rates.cutoffs_[0] == tune_cutoff(
        [rows["eps"].to_numpy() for _, rows in log.groupby("trajectory", sort=False)],
        [rows["time"].to_numpy() for _, rows in log.groupby("trajectory", sort=False)],
    )
    one = log[log["trajectory"] == "step-1"]
    np.testing.assert_allclose(
        rates.transform(one)["deps"],
        differentiate(one["eps"].to_numpy(), one["time"].to_numpy(), tuning=rates.cutoffs_[0])[1],
    )


def test_without_time_a_sampling_period_serves(log):
    by_time = RateTransformer().fit_transform(log)
    by_period = RateTransformer(sampling_period=1e-2).fit_transform(log.drop(columns="time"))
    np.testing.assert_allclose(by_period["dP"], by_time["dP"], rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("routing", [False, True])
def test_in_a_search_over_trajectories(log, routing):
    """Rates, then a regression on them, searched over folds of whole trajectories, by column and by groups."""

    class Numbers(Ridge):
        def fit(self, X, y):
            return super().fit(X[["eps", "P", "deps", "dP"]], y)

        def predict(self, X):
            return super().predict(X[["eps", "P", "deps", "dP"]])

    y = np.gradient(log["P"].to_numpy())
    model = Pipeline([("rates", RateTransformer()), ("fit", Numbers())])
    grid = {"rates__method": ["savgol", "kalman"], "fit__alpha": [1e-3, 1.0]}
    with sklearn.config_context(enable_metadata_routing=routing):
        search = GridSearchCV(model, grid, cv=TrajectoryKFold(2), error_score="raise").fit(log, y)
        assert np.isfinite(search.best_score_)
        nameless, groups = log.drop(columns="trajectory"), log["trajectory"].to_numpy()
        if routing:
            search = GridSearchCV(model, grid, cv=TrajectoryKFold(2), error_score="raise")
            assert np.isfinite(search.fit(nameless, y, groups=groups).best_score_)
            scores = cross_validate(
                model, nameless, y, cv=TrajectoryKFold(2), params={"groups": groups}, error_score="raise"
            )
            assert np.isfinite(scores["test_score"]).all()
        else:
            with pytest.raises(errors.MissingTrajectoryError):
                cross_validate(model, nameless, y, cv=TrajectoryKFold(2), groups=groups, error_score="raise")


def test_fit_transform_is_fit_then_transform(log):
    """What a check that one_trajectory leaves out would show."""
    run = log[log["trajectory"] == "sine-1"][["time", "eps"]].to_numpy()
    rates = RateTransformer(columns=[1], time=0, one_trajectory=True)
    first = rates.fit_transform(run)
    np.testing.assert_array_equal(first, rates.transform(run))
    np.testing.assert_array_equal(first, RateTransformer(columns=[1], time=0, one_trajectory=True).fit_transform(run))


@pytest.mark.parametrize(
    ("change", "options", "expected", "words"),
    [
        (lambda d: d.drop(columns="trajectory"), {}, errors.MissingTrajectoryError, "RateTransformer needs"),
        (lambda d: d.iloc[::-1], {}, errors.TimeOrderError, "does not increase"),
        (lambda d: d.sample(frac=1, random_state=0), {}, errors.InterleavedTrajectoryError, "separate blocks"),
        (lambda d: d.drop(columns="P"), {}, errors.MissingColumnError, "no column 'P'"),
        (lambda d: d.drop(columns="time"), {}, errors.MissingColumnError, "no time column 'time'"),
        (lambda d: d, {"columns": "eps"}, errors.ParameterError, "columns is 'eps'"),
        (lambda d: d, {"columns": ()}, errors.ParameterError, "columns is"),
        (lambda d: d, {"columns": [9]}, errors.MissingColumnError, "column 9"),
        (lambda d: d, {"method": "spectral"}, errors.UnknownOptionError, "spectral"),
        (lambda d: d, {"tuning": 0.0}, errors.ParameterError, "positive cut-off"),
        (lambda d: d.assign(deps=0.0), {}, errors.DuplicateColumnError, "already has the column deps"),
        (lambda d: d.iloc[:151], {}, errors.ShortTrajectoryError, "1 sample"),
    ],
)
def test_bad_tables(log, change, options, expected, words):
    with pytest.raises(expected, match=words):
        RateTransformer(**options).fit_transform(change(log))


# --- signals that a known input drives --------------------------------------------------------------------------
def driven_log(runs=3, rows=800, noise=1e-3):
    """A signal whose rate is a smooth one plus 4 times a command that jumps every now and then."""
    rng, parts = np.random.default_rng(5), []
    t = np.arange(rows) * 1e-3
    for k in range(runs):
        u = np.repeat(rng.uniform(-1, 1, rows // 50), 50)
        smooth = 2.0 * np.cos(2.0 * t + k)
        rate = smooth + 4.0 * u
        y = np.sin(2.0 * t + k) + 4.0 * held_integral(u[:, None], t)[:, 0] + noise * rng.standard_normal(rows)
        parts.append(pd.DataFrame({"trajectory": f"run-{k}", "time": t, "y": y, "u": u, "rate": rate}))
    return pd.concat(parts, ignore_index=True)


@pytest.mark.parametrize("method", METHODS)
def test_a_known_input_takes_the_jumps_of_a_rate(method):
    log = driven_log()
    X = log[["trajectory", "time", "y", "u"]]
    plain = RateTransformer(columns=("y",), method=method).fit(X)
    driven = RateTransformer(columns=("y",), method=method, inputs={"y": ["u"]}).fit(X)
    error, left = (np.std(r.transform(X)["dy"] - log["rate"]) for r in (plain, driven))
    assert left < 0.1 * error
    assert driven.gains_[0] == pytest.approx([4.0], rel=0.01)
    assert driven.cutoffs_[0] < 0.5 * plain.cutoffs_[0]  # what is left is smooth
    again = RateTransformer(columns=("y",), method=method, inputs={"y": ["u"]}, tuning=float(driven.cutoffs_[0])).fit(X)
    assert again.gains_[0] == pytest.approx([4.0], rel=0.01)


def test_an_input_that_never_changes_takes_nothing():
    log = driven_log(runs=1).assign(u=1.0, v=lambda d: d["u"])
    gains, _ = fit_gains([log["y"]], [log[["u", "v"]]], [log["time"]])
    assert gains.tolist() == [0.0, 0.0]


def test_inputs_of_a_rate_are_checked():
    X = driven_log(runs=1)[["trajectory", "time", "y", "u"]]
    for inputs in ({"y": "u"}, {"y": []}, {"z": ["u"]}):
        with pytest.raises(errors.ParameterError, match="inputs"):
            RateTransformer(columns=("y",), inputs=inputs).fit(X)
    with pytest.raises(errors.MissingColumnError, match="valve"):
        RateTransformer(columns=("y",), inputs={"y": ["valve"]}).fit(X)
    with pytest.raises(errors.ParameterError, match="second"):
        RateTransformer(columns=("y",), inputs={"y": ["u"]}, second=True).fit(X)
    with pytest.raises(errors.NonFiniteError, match="row 4"):
        fit_gains([X["y"]], [X[["u"]].mask(X["time"] == X["time"][3])], [X["time"]])
    with pytest.raises(errors.ShapeError, match="samples"):
        fit_gains([X["y"]], [X["u"]], [X["time"]])

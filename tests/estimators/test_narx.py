"""Autoregressive models: lags stay within runs, derivatives are exact, free runs are good, bounded and flagged."""

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import NNARX, PolynomialNARX

from pamid.errors import MissingTrajectoryError, ParameterError, UnstableRunWarning
from pamid.fitting import free_run

EACH = [
    NNARX(("u",), hidden=4, output_lags=1, input_lags=1, start="before", random_state=0),
    PolynomialNARX(("u",), output_lags=1, input_lags=1, n_terms=6, start="before"),
]
each_model = pytest.mark.parametrize("model", EACH, ids=lambda m: type(m).__name__)


def response(u, first, gain=0.3):
    y, out = first, []
    for now in u:
        y = y + 0.2 * (np.tanh(now) + gain * now**2 - y)
        out.append(y)
    return np.array(out)


def runs(n_runs=4, n=120, seed=0, noise=0.0, scale=1.0):
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(n_runs):
        u = scale * np.repeat(rng.uniform(-1, 1, n // 8), 8)
        first = rng.uniform(-0.5, 0.5)
        y = response(u, first)
        parts.append(
            pd.DataFrame({"trajectory": f"r{k}", "u": u, "before": first, "y": y + noise * rng.normal(size=len(u))})
        )
    return pd.concat(parts, ignore_index=True)


def inputs(table):
    return table[["trajectory", "u", "before"]]


@each_model
def test_free_runs_on_unseen_runs(model, recwarn):
    train, test = runs(), runs(seed=1)
    free = model.fit(inputs(train), train["y"]).predict(inputs(test))
    assert np.sqrt(np.mean((free - test["y"]) ** 2)) < 0.03 * np.std(test["y"])
    assert not [w for w in recwarn if issubclass(w.category, UnstableRunWarning)]
    ahead = model.predict_one_step(inputs(test), test["y"])
    assert np.sqrt(np.mean((ahead - test["y"]) ** 2)) < 0.03 * np.std(test["y"])


@each_model
def test_noise_biases_single_steps_and_not_free_runs(model):
    train, test = runs(8, noise=0.15), runs(seed=1)
    error = {}
    for horizon in (1, 40):
        fit = type(model)(**model.get_params()).set_params(horizon=horizon).fit(inputs(train), train["y"])
        error[horizon] = np.sqrt(np.mean((fit.predict(inputs(test)) - test["y"]) ** 2))
    assert error[40] < 0.6 * error[1]


@each_model
def test_derivatives_along_a_run_are_exact(model):
    train = runs(2, 40)
    fit = type(model)(**model.get_params()).set_params(output_lags=2, input_lags=2, max_iter=2)
    fit.fit(inputs(train), train["y"])
    rng = np.random.default_rng(0)
    u, z = rng.normal(size=(40, 1)), rng.normal(size=40)
    slices, step_model, scale = [slice(0, 25), slice(25, 40)], fit._model(), fit.step_scale_
    inputs_before, past, _ = fit._lags(u, z, slices)
    stretches = free_run.segments(inputs_before, z, past, slices, 10)
    theta = fit._theta()

    def loss(at):
        return free_run.squared_error(step_model, at, stretches, scale)

    found = free_run.normal_equations(step_model, theta, stretches, scale)
    assert found.loss == pytest.approx(loss(theta))
    for k in range(0, len(theta), 3):
        step = np.zeros(len(theta))
        step[k] = 1e-6
        slope = (loss(theta + step) - loss(theta - step)) / 2e-6
        assert 2 * found.gradient[k] == pytest.approx(slope, rel=1e-4, abs=1e-6)


@each_model
def test_nothing_passes_from_run_to_run(model):
    train, test = runs(), runs(seed=1)
    model.fit(inputs(train), train["y"])
    together = model.predict(inputs(test))
    for _, run in test.groupby("trajectory"):
        np.testing.assert_allclose(model.predict(inputs(run)), together[run.index], rtol=1e-10)


@each_model
def test_an_unstable_run_is_held_at_its_edge_and_flagged(model):
    train = runs()
    fit = type(model)(**model.get_params()).set_params(margin=0.1).fit(inputs(train), train["y"])
    name = "W1" if isinstance(fit, NNARX) else None
    if name:
        fit.weights_ = fit.weights_ | {"W1": -30.0 * fit.weights_["W1"]}
    else:
        fit.coef_ = -30.0 * fit.coef_
    run = fit.simulate(inputs(train))
    span = fit.output_high_ - fit.output_low_
    assert run.held.any() and np.isfinite(run.y).all()
    assert run.y.max() <= fit.output_high_ + 0.1 * span + 1e-9
    assert run.y.min() >= fit.output_low_ - 0.1 * span - 1e-9
    with pytest.warns(UnstableRunWarning, match="held"):
        fit.predict(inputs(train))


@each_model
def test_inputs_beyond_the_fit_are_flagged(model):
    train, far = runs(), runs(seed=2, scale=3.0)
    run = model.fit(inputs(train), train["y"]).simulate(inputs(far))
    np.testing.assert_array_equal(run.extrapolated, np.abs(far["u"]) > np.abs(train["u"]).max() + 1e-9)
    assert np.isfinite(run.y).all()
    assert not model.simulate(inputs(train)).extrapolated.any()


def test_without_a_start_the_run_begins_at_the_mean_of_starts():
    train = runs()
    fit = NNARX(("u",), hidden=3, max_iter=5, random_state=0).fit(train[["trajectory", "u"]], train["y"])
    assert fit.start_mean_ == pytest.approx(train.groupby("trajectory")["y"].first().mean())


def test_terms_and_coefficients_are_read_off():
    train = runs()
    fit = PolynomialNARX(("u",), output_lags=1, input_lags=1, n_terms=5, start="before").fit(inputs(train), train["y"])
    assert {"y[t-1]", "u[t]"} <= set(fit.terms_) and len(fit.terms_) == len(set(fit.terms_)) <= 5
    assert set(fit.coefficients_) == set(fit.standard_errors_) == set(fit.terms_)
    assert fit.coefficients_["y[t-1]"] < 0 < fit.coefficients_["u[t]"]
    assert all(e > 0 for e in fit.standard_errors_.values())


def test_slopes_beyond_the_numbers_end_a_fit_and_not_the_program():
    from pamid.fitting.marquardt import Marquardt, Normal

    def around(x):
        return Normal(1.0, np.array([np.nan]), np.array([[np.inf]]))

    steps = Marquardt(np.ones(1), around, lambda x: float(x @ x))
    assert steps.step() is False and steps.loss == 1.0


def test_wrong_settings():
    train = runs()
    with pytest.raises(MissingTrajectoryError):
        NNARX(("u",)).fit(train[["u"]], train["y"])
    with pytest.raises(ParameterError, match="horizon"):
        NNARX(("u",), horizon=0).fit(train[["trajectory", "u"]], train["y"])
    with pytest.raises(ParameterError, match="degree"):
        PolynomialNARX(("u",), degree=0).fit(train[["trajectory", "u"]], train["y"])

"""Linear baselines: what made the data is found, runs are kept apart, and python-control gets the same model."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import LinearStateSpace, TransferFunction

from pamid.errors import ParameterError

POLES = np.array([0.9 - 0.1414j, 0.9 + 0.1414j])
GAIN = {"P": 1.0, "load": 1.0 / 3.0}


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    """Two poles that swing, two inputs, an offset of 0.1 in the output, 5 % of noise."""
    rng, parts = np.random.default_rng(0), []
    for run in range(4):
        u, w = np.repeat(rng.standard_normal(40), 20), np.repeat(rng.standard_normal(40), 20)
        y = np.full(800, 0.1)
        for k in range(2, 800):
            y[k] = 1.8 * y[k - 1] - 0.83 * y[k - 2] + 0.03 * u[k - 1] + 0.01 * w[k - 1] + 0.003
        noisy = y + 0.05 * rng.standard_normal(800)
        parts.append(pd.DataFrame({"trajectory": str(run), "P": u, "load": w, "y": noisy, "start": noisy[0]}))
    return pd.concat(parts, ignore_index=True)


def test_order_and_poles_are_found_by_subspaces(log):
    model = LinearStateSpace(start="start").fit(log, log["y"])
    assert model.order_ == 2
    np.testing.assert_allclose(np.sort_complex(model.poles_), POLES, atol=0.005)
    assert [row["order"] for row in model.orders_] == list(range(1, 9))
    assert model.orders_[1]["fit"] > model.orders_[0]["fit"] + 10
    assert model.score(log, log["y"]) > 0.98


def test_a_transfer_function_is_that_which_made_the_data(log):
    model = TransferFunction(start="start", n_zeros=1).fit(log, log["y"])
    np.testing.assert_allclose(np.sort_complex(model.poles_), POLES, atol=0.005)
    assert model.static_gains_ == pytest.approx(GAIN, abs=0.02)
    true = {"a1": -1.8, "a2": 0.83, "b1 P": 0.03, "b1 load": 0.01, "b0 P": 0.0, "b0 load": 0.0}
    far = {k: abs(model.coefficients_[k] - v) / model.standard_errors_[k] for k, v in true.items()}
    assert max(far.values()) < 4, far
    assert model.offset_ / model.denominator_.sum() == pytest.approx(0.1, abs=0.01)
    single = TransferFunction(start="start", horizon=1).fit(log, log["y"])  # ARX: biased by the noise in its lags
    assert single.score(log, log["y"]) < model.score(log, log["y"])


def test_a_delay_shifts_the_inputs(log):
    late = log.assign(y=log.groupby("trajectory")["y"].shift(7).fillna(0.1))
    with_delay, without = (
        TransferFunction(start="start", delay=d).fit(late, late["y"]).score(late, late["y"]) for d in (7, 0)
    )
    assert with_delay > without + 0.01


def test_python_control_gets_the_same_model(log):
    control = pytest.importorskip("control")
    quiet = log[log["trajectory"] == "0"].reset_index(drop=True)
    space = LinearStateSpace().fit(log, log["y"])
    mean = space.input_mean_
    ours = space.predict(quiet)
    centred = (quiet[["P", "load"]].to_numpy() - mean).T
    x0 = np.linalg.solve(np.eye(2) - space.A_, space.B_ @ (centred[:, 0] / space.input_scale_))
    theirs = control.forced_response(space.to_control(0.01), U=centred, X0=x0).outputs[0] + space.offset_
    np.testing.assert_allclose(ours, theirs, atol=1e-8)
    function = TransferFunction(delay=2).fit(log, log["y"])
    assert float(np.real(function.to_control("P", 0.01)(1.0))) == pytest.approx(function.static_gains_["P"])


def test_settings_that_cannot_be(log):
    with pytest.raises(ParameterError, match="n_poles"):
        TransferFunction(n_poles=0).fit(log, log["y"])
    with pytest.raises(ParameterError, match="block_rows"):
        LinearStateSpace(order=9, block_rows=9).fit(log, log["y"])


def test_runs_too_short_for_dynamics_give_a_gain():
    X = pd.DataFrame({"trajectory": np.arange(50), "P": np.linspace(0, 1, 50), "load": np.linspace(0, 1, 50) ** 2})
    y = 3 * X["P"] - 2 * X["load"] + 1
    model = LinearStateSpace().fit(X, y)
    np.testing.assert_allclose(model.predict(X), y, atol=1e-9)

"""Volume networks against autograd and at the borders of their data; hybrid models in searches over pipelines."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
import sklearn
import torch
from pamid.estimators import JointPIHM, RateTransformer, StaticPIHM
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import Pipeline
from sklearn.utils.fixes import parse_version

from pamid.errors import MissingTrajectoryError, UnitWarning, UnknownOptionError
from pamid.signals.state import State
from pamid.training.network import ACTIVATIONS
from pamid.volume.neural import InputScale, NeuralVolume

QUICK = {"rest_length": 0.2, "rest_diameter": 0.02, "hidden_layer_sizes": (8,), "max_iter": 15, "random_state": 0}
PLAIN = {"softplus": torch.nn.functional.softplus, "tanh": torch.tanh, "silu": torch.nn.functional.silu}


def force(eps, P):
    return (P - 101_325.0) * 8e-4 * (1 - 3.3 * eps)


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    """Six runs with time, contraction and pressure, no rates."""
    t, parts = np.arange(0, 2, 0.02), []
    for k in range(6):
        eps, P = 0.12 + 0.06 * np.sin((1 + k) * t + k), 3e5 + 8e4 * np.sin((2 + 0.7 * k) * t)
        parts.append(pd.DataFrame({"trajectory": f"sine-{k}", "time": t, "eps": eps, "P": P, "F": force(eps, P)}))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.column_stack(
        [rng.uniform(0, 0.25, 300), rng.normal(0, 0.4, 300), rng.uniform(1.5e5, 7e5, 300), rng.normal(0, 5e5, 300)]
    )


def networks(states: np.ndarray, activation: str, *, correction: bool) -> NeuralVolume:
    rng = np.random.default_rng(2)
    weights = [rng.normal(0, 0.5, shape) for shape in ((9, 4), (9,), (7, 9), (7,), (1, 7), (1,))]
    return NeuralVolume(weights, InputScale.of(states, correction=correction), 1e-5, activation)


# --- the volume network ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("activation", sorted(ACTIVATIONS))
def test_the_jet_of_a_network_is_that_of_autograd(activation, states):
    model = networks(states, activation, correction=False)
    x = torch.tensor(states, requires_grad=True)
    h = (x - torch.tensor(model.scale.mean)) / torch.tensor(model.scale.spread)
    for k in range(0, 4, 2):
        h = PLAIN[activation](h @ torch.tensor(model.weights[k]).T + torch.tensor(model.weights[k + 1]))
    V = 1e-5 * (h @ torch.tensor(model.weights[4]).T + torch.tensor(model.weights[5]))[:, 0]
    (slope,) = torch.autograd.grad(V.sum(), x)
    jet = model.jet(State(*states.T))
    np.testing.assert_allclose(jet.V, V.detach(), rtol=1e-9)
    np.testing.assert_allclose(jet.V_eps, slope[:, 0], rtol=1e-8, atol=1e-15)
    np.testing.assert_allclose(jet.V_P, slope[:, 2], rtol=1e-8, atol=1e-20)


@pytest.mark.parametrize("signal", range(4))
def test_a_correction_is_smooth_across_the_border_of_its_data(signal, states):
    """Its slopes are the derivatives of its value on both sides, and do not jump where the clamp begins."""
    model = networks(states, "softplus", correction=True)
    x = np.tile(np.median(states, axis=0), (2001, 1))
    low, high = states[:, signal].min(), states[:, signal].max()
    x[:, signal] = np.linspace(low - 0.5 * (high - low), high + 0.5 * (high - low), 2001)
    jet = model.jet(State(*x.T))
    step = x[1, signal] - x[0, signal]
    if signal in (0, 2):
        slope = jet.V_eps if signal == 0 else jet.V_P
        numeric = (jet.V[2:] - jet.V[:-2]) / (2 * step)
        np.testing.assert_allclose(slope[1:-1], numeric, atol=2e-4 * np.abs(slope).max())
        assert np.abs(slope[[0, -1]]).max() < 0.02 * np.abs(slope).max()
    for values in jet:
        assert np.abs(np.diff(values)).max() < 0.02 * (np.ptp(values) + 1e-30)


# --- fits -----------------------------------------------------------------------------------------------------
def test_targets_with_gaps_and_held_out_runs_go_together(log):
    """Rows whose force was not measured are held out with their run all the same."""
    X = RateTransformer().fit_transform(log.drop(columns="F"))
    Y = np.column_stack([log["F"], 1e-4 * X["deps"] + 1e-10 * X["dP"]])
    Y[::3, 0], Y[1::5, 1] = np.nan, np.nan
    model = JointPIHM(**QUICK, validation_fraction=0.3).fit(X, Y)
    assert len(model.validation_curve_) == model.n_iter_ and np.all(np.isfinite(model.validation_curve_))


def test_gaps_in_a_target_do_not_blind_the_anchor(log):
    """The geometry found from half of the forces is that found from all of them."""
    X = RateTransformer().fit_transform(log.drop(columns="F"))
    V, V_eps = 7e-5 + 1.6e-4 * X["eps"] * (1 - 1.65 * X["eps"]), 1.6e-4 * (1 - 3.3 * X["eps"])
    mdot = X["dP"] * V / (1.4 * 287 * 293) + X["P"] * V_eps * X["deps"] / (287 * 293)
    whole = np.column_stack([log["F"], mdot])
    gaps = whole.copy()
    gaps[::2, 0] = np.nan
    areas = [JointPIHM(**QUICK).fit(X, Y).anchor_.area for Y in (whole, gaps)]
    assert areas[1] == pytest.approx(areas[0], rel=0.01)
    assert areas[0] == pytest.approx(8e-4, rel=0.05)


def test_a_kinked_activation_is_refused(log):
    X = RateTransformer().fit_transform(log.drop(columns="F"))
    with pytest.raises(UnknownOptionError, match="softplus"):
        StaticPIHM(**QUICK, activation="relu").fit(X, log["F"])


def test_lengths_in_mm_are_noticed(log):
    X = RateTransformer().fit_transform(log.drop(columns="F"))
    with pytest.warns(UnitWarning), warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=RuntimeWarning)
        StaticPIHM(**QUICK).fit(X.assign(eps=200 * X["eps"]), log["F"])  # contraction in mm of a 200 mm muscle


def test_partial_fits_on_one_corner_do_not_forget_the_rest(log):
    """What is learnt where the batch lies moves the rest by no more than the drift itself."""
    X = RateTransformer().fit_transform(log.drop(columns="F"))
    model = StaticPIHM(**QUICK).fit(X, log["F"])
    corner = (X["P"] > 3.5e5).to_numpy()
    drifted = np.where(corner, 0.97, 1.0) * log["F"]
    before = [np.sqrt(np.mean((model.predict(X[rows]) - drifted[rows]) ** 2)) for rows in (corner, ~corner)]
    for _ in range(4):
        model.partial_fit(X[corner], drifted[corner])
    after = [np.sqrt(np.mean((model.predict(X[rows]) - drifted[rows]) ** 2)) for rows in (corner, ~corner)]
    assert after[0] < 0.5 * before[0]
    assert after[1] < before[1] + 0.03 * log["F"].mean()


# --- searches -------------------------------------------------------------------------------------------------
@pytest.fixture(params=[False, True], ids=["routing off", "routing on"])
def routing(request):
    with sklearn.config_context(enable_metadata_routing=request.param):
        yield request.param


def search() -> GridSearchCV:
    steps = [("rates", RateTransformer()), ("model", StaticPIHM(**QUICK, validation_fraction=0.3))]
    return GridSearchCV(
        Pipeline(steps), {"model__hidden_layer_sizes": [(4,), (8,)]}, cv=GroupKFold(2), error_score="raise"
    )


def test_a_search_over_a_pipeline_keeps_whole_runs_together(log, routing):
    """A column tells rates and early stopping the runs where routing is off; groups do where it is on."""
    groups = log["trajectory"].to_numpy()
    X = log.drop(columns="F")
    if routing and parse_version(sklearn.__version__) >= parse_version(
        "1.8"
    ):  # before, groups do not reach the scoring
        found = search().fit(X.drop(columns="trajectory"), log["F"], groups=groups)
    else:
        found = search().fit(X, log["F"], groups=groups)
    assert found.best_score_ > 0.99
    assert found.best_estimator_[-1].validation_curve_


def test_a_search_that_is_told_no_runs_raises(log):
    with pytest.raises(MissingTrajectoryError, match="RateTransformer"):
        search().fit(log.drop(columns=["F", "trajectory"]), log["F"], groups=log["trajectory"].to_numpy())

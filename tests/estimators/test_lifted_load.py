"""A force model under a load in free run: follows lifts unseen, stays bounded, and says what it cannot use."""

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import MLP, GeometricForce, LiftedLoad, PolynomialForce

from pamid.bench.single import LiftSettings, simulate_lift
from pamid.compare import candidates
from pamid.errors import ExcitationWarning, IncompatibleError, ParameterError, TimeOrderError, UnstableRunWarning

READ = ["trajectory", "time", "P", "load"]


@pytest.fixture(scope="module")
def log():
    return simulate_lift(loads=[20, 40, 80], every=40, settings=LiftSettings(frequency=0.25))


@pytest.mark.parametrize("model", [None, GeometricForce("tondu_lopez", rest_length=0.2, rest_diameter=0.02)])
def test_follows_a_load_it_was_not_trained_on(log, model):
    test = simulate_lift(loads=[60], every=40, seed=1, settings=LiftSettings(frequency=0.25))
    fit = LiftedLoad(model).fit(log[READ], log["eps"])
    error = fit.predict(test[READ]) - test["eps"]
    assert np.sqrt(np.mean(error**2)) < 0.1 * test["eps"].std()
    assert 0 < fit.n_lifted_ < len(log)


def test_a_spring_settles_where_force_and_weight_balance():
    rng = np.random.default_rng(0)
    X = pd.DataFrame({"P": rng.uniform(3e5, 6e5, 40), "load": rng.choice([10.0, 15.0, 20.0], 40)})
    X = X.assign(trajectory=np.arange(40)).loc[np.repeat(np.arange(40), 20)].reset_index(drop=True)
    eps = (1e-3 * (X["P"] - 101_325) - 9.80665 * X["load"]) / 2000.0  # of F = 1e-3 p - 2000 eps
    model = LiftedLoad(PolynomialForce(1, "surface"), time=None, step=0.25).fit(X, eps)
    run = model.simulate(X[:200])
    last = np.arange(19, 200, 20)
    assert np.allclose(run.y[last], eps[last], atol=2e-3)


def test_one_load_is_warned_of(log):
    one = log[log["load"] == 40]
    with pytest.warns(ExcitationWarning, match="40 kg"):
        LiftedLoad(GeometricForce()).fit(one[READ], one["eps"])


def test_runs_that_leave_the_fit_are_held_and_flagged(log):
    model = LiftedLoad(PolynomialForce(1, "surface"), margin=0.02).fit(log[READ], log["eps"])
    X = log[READ].assign(P=3e6, load=1.0)
    run = model.simulate(X)
    assert run.held.any()
    assert run.extrapolated.all()
    assert run.y.max() <= log["eps"].max() + 0.03 * np.ptp(log["eps"])
    with pytest.warns(UnstableRunWarning, match="held"):
        model.predict(X)


def test_what_it_cannot_use_is_refused(log):
    with pytest.raises(TimeOrderError, match="increase"):
        LiftedLoad().fit(log[READ].assign(time=0.0), log["eps"])
    with pytest.raises(ParameterError, match="load"):
        LiftedLoad().fit(log[READ].assign(load=-1.0), log["eps"])
    with pytest.raises(IncompatibleError, match="MLP"):
        LiftedLoad(MLP(inputs=("eps", "P", "load"))).fit(log[READ], log["eps"])


def test_takes_part_where_a_contraction_runs_freely_and_nowhere_else():
    assert candidates("dynamic", ["LiftedLoad"], output="eps")
    assert "LiftedLoad" not in {c.label.split("(")[0] for c in candidates("dynamic", output="P")}

"""The plain network baselines: what they learn, what weights and trajectories mean to them, streaming, bad input."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import torch
from pamid.estimators import MLP, Recurrent, SINDyModel, SINDyRegressor
from sklearn.base import clone

from pamid.errors import (
    DivergedError,
    ExcitationWarning,
    InterleavedTrajectoryError,
    MissingColumnError,
    MissingTrajectoryError,
    ParameterError,
    TooFewTrajectoriesError,
    UnknownOptionError,
)
from pamid.fitting.epochs import Best, held_out_rows
from pamid.fitting.recurrent import Network, Piece, index_table, initial_weights, pieces_of


@pytest.fixture(scope="module")
def static():
    """A smooth force of contraction and pressure, eight trajectories of fifty rows."""
    rng = np.random.default_rng(5)
    X = pd.DataFrame({"eps": rng.uniform(0, 0.25, 400), "P": rng.uniform(1e5, 7e5, 400)})
    return X, 1e-3 * (X["P"] - 1e5) * (1 - 2.5 * X["eps"]) ** 2, np.repeat(np.arange(8), 50)


@pytest.fixture(scope="module")
def lagging():
    """A force that follows the pressure with a lag of four rows, which starts settled in each of six trajectories."""
    rng = np.random.default_rng(6)
    runs = []
    for k in range(6):
        P = np.repeat(rng.uniform(1e5, 7e5, 15), 10)
        F = np.empty(150)
        F[0] = 1e-3 * P[0]
        for i in range(1, 150):
            F[i] = F[i - 1] + 0.22 * (1e-3 * P[i] - F[i - 1])
        runs.append(pd.DataFrame({"P": P, "F": F, "trajectory": f"run {k}"}))
    return pd.concat(runs, ignore_index=True)


SMALL = MLP(("eps", "P"), hidden=(8, 8), random_state=0)


# --- the plain network ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("activation", ["tanh", "softplus", "relu"])
@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_mlp_learns_a_smooth_force(activation, optimizer, static):
    X, y, groups = static
    model = clone(SMALL).set_params(activation=activation, optimizer=optimizer, batch_size=32, max_iter=120)
    train = groups < 6
    model.fit(X[train], y[train])
    assert model.score(X[~train], y[~train]) > 0.98


def test_prediction_is_the_network_of_torch(static):
    """The forward pass in numpy is the one that was trained."""
    X, y, _ = static
    for activation in ("tanh", "softplus", "relu"):
        model = clone(SMALL).set_params(activation=activation, max_iter=3).fit(X, y)
        tensors = {name: torch.as_tensor(w) for name, w in model.weights_.items()}
        inputs = torch.as_tensor((X.to_numpy() - model.input_mean_) / model.input_scale_)
        outputs = model._forward(tensors, inputs).numpy() * model.target_scale_ + model.target_mean_
        np.testing.assert_allclose(model.predict(X), outputs, rtol=1e-12)


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_weights_equal_repetition(optimizer, static):
    X, y, _ = static
    weights = np.random.default_rng(0).integers(0, 3, 100)
    model = clone(SMALL).set_params(optimizer=optimizer, max_iter=15)
    weighted = clone(model).fit(X[:100], y[:100], sample_weight=weights)
    repeated = clone(model).fit(X[:100].loc[np.repeat(np.arange(100), weights)], np.repeat(y[:100], weights))
    np.testing.assert_allclose(weighted.predict(X), repeated.predict(X), rtol=1e-6)


def test_best_weights_are_kept(static):
    """With a rate that is far too high the last epoch is worse; the fit keeps the weights of the best one."""
    X, y, _ = static
    model = clone(SMALL).set_params(learning_rate=0.3, batch_size=400, max_iter=2).fit(X, y)
    loss = np.mean(((model.predict(X) - y) / model.target_scale_) ** 2)
    assert loss == pytest.approx(min(model.loss_curve_), rel=1e-9)
    assert model.loss_curve_[-1] > min(model.loss_curve_)


def test_early_stopping_holds_out_whole_trajectories(static, monkeypatch):
    X, y, groups = static
    seen = []
    monkeypatch.setattr("pamid.estimators.mlp.held_out_rows", lambda *a: seen.append(held_out_rows(*a)) or seen[-1])
    model = clone(SMALL).set_params(early_stopping=True, validation_fraction=0.25, max_iter=300, patience=3)
    model.fit(X, y, groups=groups)
    (mask,) = seen
    assert all(len(np.unique(mask[groups == g])) == 1 for g in range(8))
    assert len(np.unique(groups[mask])) == 2
    assert model.n_iter_ < 300
    error = np.mean(((model.predict(X[mask]) - y[mask]) / model.target_scale_) ** 2)
    assert error == pytest.approx(min(model.validation_curve_), rel=1e-9)


def test_partial_fit_learns_from_a_stream(static):
    """Pieces make the model of one fit; a row that comes again is remembered once and counts twice."""
    X, y, _ = static
    model = clone(SMALL).set_params(batch_size=50)
    for start in range(0, len(X), 100):
        model.partial_fit(X[start : start + 100], y[start : start + 100])
    whole = clone(model).fit(X, y)
    np.testing.assert_allclose(model.predict(X), whole.predict(X))
    model.partial_fit(X[:100], y[:100])
    assert len(model._recalled()) == len(X)
    assert model._recalled().weight.sum() == len(X) + 100
    assert model.score(X, y) > whole.score(X, y) - 0.5 * (1 - whole.score(X, y))
    assert len(model.loss_curve_) == model.n_iter_


def test_weight_decay_shrinks(static):
    X, y, _ = static
    sizes = [
        sum(float((w**2).sum()) for n, w in m.weights_.items() if n.startswith("W"))
        for m in (clone(SMALL).set_params(alpha=a, optimizer="lbfgs", max_iter=60).fit(X, y) for a in (0.0, 0.01))
    ]
    assert sizes[1] < 0.5 * sizes[0]


def test_large_prediction_in_chunks(static):
    X, y, _ = static
    model = clone(SMALL).set_params(max_iter=2).fit(X, y)
    many = pd.concat([X] * 330, ignore_index=True)
    np.testing.assert_allclose(model.predict(many)[-400:], model.predict(X), rtol=1e-12)


BAD_MLP = {
    "activation": ({"activation": "sine"}, UnknownOptionError),
    "optimizer": ({"optimizer": "newton"}, UnknownOptionError),
    "batch": ({"batch_size": 0}, ParameterError),
    "epochs": ({"max_iter": 2.5}, ParameterError),
    "rate": ({"learning_rate": float("nan")}, ParameterError),
    "units": ({"hidden": (4, 0)}, ParameterError),
    "column": ({"inputs": ("eps", "mdot")}, MissingColumnError),
    "held-out share": ({"early_stopping": True, "validation_fraction": 1.5}, ParameterError),
}


@pytest.mark.parametrize("case", BAD_MLP)
def test_bad_parameters_of_mlp(case, static):
    changes, error = BAD_MLP[case]
    X, y, groups = static
    with pytest.raises(error):
        clone(SMALL).set_params(**changes).fit(X, y, groups=groups)


@pytest.mark.parametrize(
    "model",
    [
        MLP(("eps", "P"), max_iter=1),
        Recurrent(("eps", "P"), max_iter=1, one_trajectory=True),
        SINDyRegressor(("eps", "P")),
        SINDyModel(("P",), ("eps",), one_trajectory=True, sampling_period=0.01),
    ],
    ids=lambda m: type(m).__name__,
)
def test_still_signal_is_told_before_the_fit(model, static):
    X, y, _ = static
    with pytest.warns(ExcitationWarning, match="eps does not vary"):
        clone(model).fit(X.assign(eps=0.1), y)


def test_early_stopping_needs_trajectories(static):
    X, y, _ = static
    model = clone(SMALL).set_params(early_stopping=True)
    with pytest.raises(MissingTrajectoryError, match="early_stopping=False"):
        model.fit(X, y)
    with pytest.raises(TooFewTrajectoriesError, match="only one run"):
        model.fit(X, y, groups=np.zeros(len(y)))


def test_diverging_loss_is_told():
    best = Best(patience=3, tol=0.0)
    with pytest.raises(DivergedError, match="learning_rate"):
        best.offer(float("nan"), dict)
    best = Best(patience=3, tol=0.0)
    assert not best.offer(1.0, lambda: {"W0": np.ones(1)})
    assert best.offer(float("inf"), dict)
    assert best.score == 1.0


def test_small_improvements_do_not_count():
    """Steps below tol of the reference are waited through, even if each is the best so far."""
    best = Best(patience=3, tol=0.1)
    scores = [1.0, 0.95, 0.94, 0.93]
    assert [best.offer(score, dict) for score in scores] == [False, False, False, True]
    assert best.score == 0.93
    best = Best(patience=3, tol=0.1)
    assert not any(best.offer(0.8**k, dict) for k in range(20))


# --- the recurrent network ------------------------------------------------------------------------------------
@pytest.mark.parametrize("cell", ["gru", "lstm", "elman"])
def test_recurrent_learns_a_lag(cell, lagging):
    """On unseen trajectories the lag is followed, where the same row means different forces to a plain network."""
    X, y = lagging[["P", "trajectory"]], lagging["F"]
    train = lagging["trajectory"] < "run 4"
    model = Recurrent(("P",), cell=cell, hidden=8, window=30, max_iter=60, random_state=0).fit(X[train], y[train])
    plain = MLP(("P",), hidden=(8,), max_iter=60, random_state=0).fit(X[train], y[train])
    assert model.score(X[~train], y[~train]) > 0.97
    assert plain.score(X[~train], y[~train]) < 0.8


def test_trajectories_do_not_touch(lagging):
    """A trajectory's prediction is the same alone, in other company, and in any order of trajectories."""
    X, y = lagging[["P", "trajectory"]], lagging["F"]
    model = Recurrent(("P",), hidden=4, max_iter=2, random_state=0).fit(X, y)
    together = model.predict(X)
    for name, run in X.groupby("trajectory"):
        np.testing.assert_allclose(model.predict(run), together[X["trajectory"] == name], rtol=1e-10)
    backwards = pd.concat([run for _, run in reversed(list(X.groupby("trajectory")))])
    np.testing.assert_allclose(
        pd.Series(model.predict(backwards), index=backwards.index).sort_index(), together, rtol=1e-10
    )


def test_fit_does_not_look_across_borders(lagging):
    """What is true of a neighbour's rows changes nothing in the sequences of a trajectory."""
    pieces = pieces_of([slice(0, 150), slice(150, 230)], 60)
    lead, table, real = index_table(pieces, 25)
    for k, piece in enumerate(pieces):
        last = 150 if piece.first == 0 else 230
        assert lead[k].min() >= piece.first
        assert table[k][real[k]].tolist() == list(range(piece.start, piece.stop))
        assert table[k].max() < last
    assert sorted(table[real].tolist()) == list(range(230))
    assert (Piece(150, 210, 150).lead(5) == 150).all()
    assert Piece(60, 120, 0).lead(3).tolist() == [57, 58, 59]


@pytest.mark.parametrize("cell", ["gru", "lstm", "elman"])
def test_carried_state(cell):
    """Windows with a carried state give what one run over the whole sequence gives."""
    weights = initial_weights(np.random.default_rng(0), cell, 2, 5, 2)
    network = Network(cell, 2, 5, 2, {n: torch.as_tensor(w) for n, w in weights.items()})
    x = torch.as_tensor(np.random.default_rng(1).normal(size=(3, 40, 2)))
    with torch.no_grad():
        whole, _ = network.run(x)
        first, state = network.run(x[:, :17])
        second, _ = network.run(x[:, 17:], state)
    np.testing.assert_allclose(torch.cat([first, second], 1), whole, rtol=1e-12)


@pytest.mark.parametrize("window", [7, 40, 1000])
def test_windows_carry_their_state_in_the_fit(window, lagging):
    """While nothing is learnt, the loss met window by window is the error of a prediction along the trajectories."""
    X, y = lagging[["P", "trajectory"]], lagging["F"]
    model = Recurrent(("P",), hidden=4, window=window, segment_length=None, learning_rate=0.0, max_iter=1)
    model.fit(X, y)
    error = np.mean(((model.predict(X) - y) / model.target_scale_) ** 2)
    assert model.loss_curve_[0] == pytest.approx(error, rel=1e-9)


def test_burn_in_settles_the_start(lagging):
    """A constant input gives a constant output from the first row on, once the burn-in is long enough."""
    X, y = lagging[["P", "trajectory"]], lagging["F"]
    still = pd.DataFrame({"P": np.full(40, 3e5), "trajectory": "still"})
    drift = []
    for burn_in in (0, 200):
        model = Recurrent(("P",), hidden=4, burn_in=burn_in, max_iter=20, random_state=0).fit(X, y)
        drift.append(np.ptp(model.predict(still)) / model.target_scale_)
    assert drift[1] < 1e-3 < drift[0]


def test_recurrent_early_stopping(lagging):
    X, y = lagging[["P", "trajectory"]], lagging["F"]
    model = Recurrent(("P",), hidden=4, early_stopping=True, max_iter=15, window=30, random_state=0).fit(X, y)
    assert len(model.validation_curve_) == model.n_iter_
    assert model.validation_curve_[-1] < model.validation_curve_[0]


def test_recurrent_partial_fit(lagging):
    X, y = lagging[["P", "trajectory"]], lagging["F"]
    model = Recurrent(("P",), hidden=6, window=30, random_state=0)
    for _, run in X.groupby("trajectory"):
        model.partial_fit(run, y[run.index])
    assert model.score(X, y) > 0.9


def test_position_tells_trajectories(lagging):
    """In an array without names the position of a column tells trajectories as its name does in a table."""
    X, y = lagging[["P", "trajectory"]], lagging["F"]
    codes = pd.factorize(X["trajectory"])[0]
    by_name = Recurrent(("P",), hidden=3, max_iter=2, random_state=0).fit(X, y)
    by_position = Recurrent(("P",), hidden=3, max_iter=2, random_state=0, trajectory_column=1, signals={"P": 0}).fit(
        np.column_stack([X["P"], codes]), y
    )
    np.testing.assert_allclose(by_position.predict(np.column_stack([X["P"], codes])), by_name.predict(X))


def test_recurrent_needs_trajectories(lagging):
    X, y = lagging[["P"]], lagging["F"]
    model = Recurrent(("P",), hidden=2, max_iter=1)
    with pytest.raises(MissingTrajectoryError, match="one_trajectory"):
        model.fit(X, y)
    with pytest.raises(InterleavedTrajectoryError):
        model.fit(X, y, groups=np.arange(len(y)) % 2)
    model.fit(X, y, groups=lagging["trajectory"])
    with pytest.raises(MissingTrajectoryError):
        model.predict(X)
    with pytest.raises(UnknownOptionError, match="gru"):
        model.set_params(cell="quantum").fit(X, y)

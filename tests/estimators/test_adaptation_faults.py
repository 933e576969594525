"""Adaptation: what is refused or warned of, intervals, the command line."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from pamid.estimators import (
    ConformalRegressor,
    QAdapter,
)
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LinearRegression
from support.sources import SIGNALS, table

from pamid.errors import (
    AdaptationWarning,
    ExcitationWarning,
    ExtrapolationWarning,
    IncompatibleError,
    InterruptedFitWarning,
    MissingColumnError,
    MissingTrajectoryError,
    ParameterError,
    UnknownOptionError,
)
from pamid.persistence import load
from pamid.training import Adam, LevenbergMarquardt


# --- bad input ------------------------------------------------------------------------------------------------
def test_unfitted_source_names_the_remedy(flow):
    few = table(1)
    with pytest.raises(IncompatibleError, match="FrozenEstimator"):
        clone(QAdapter(flow, 4.0)).fit(few, few["mdot"])
    for wrong in (None, LinearRegression(), "A"):
        with pytest.raises(IncompatibleError, match="StaticPIHM"):
            QAdapter(wrong, 4.0).fit(few, few["mdot"])
    with pytest.raises(NotFittedError):
        QAdapter(flow, 4.0).predict(few)


def test_other_laws_columns_and_units(flow, force, both):
    few = table(1)
    with pytest.raises(IncompatibleError, match="target is F"):
        QAdapter(flow, 4.0).fit(few, few["F"])
    with pytest.raises(IncompatibleError, match="F and mdot"):
        QAdapter(both, 4.0).fit(few, few["F"].to_numpy())
    with pytest.raises(MissingColumnError, match="dP"):
        QAdapter(flow, 4.0).fit(few.drop(columns="dP"), few["mdot"])
    with pytest.warns(UserWarning, match="bar"):
        QAdapter(force, 1.0, base="frozen").fit(few.assign(P=few["P"] / 1e5), few["F"])


@pytest.mark.parametrize("initial", [0.0, -2.0, np.nan, "guess"])
def test_impossible_q0(flow, initial):
    few = table(1)
    with pytest.raises(ParameterError):
        QAdapter(flow, initial).fit(few, few["mdot"])


def test_contradictions_are_told(flow):
    few = table(1, factor=4.0)
    with pytest.warns(AdaptationWarning, match=r"the sizes Q = 9"):
        QAdapter(flow, rest_length=0.45, rest_diameter=0.02, base="frozen").fit(few, few["mdot"])
    with pytest.warns(AdaptationWarning, match="factor above 0"):
        assert QAdapter(flow, 4.0, base="frozen").fit(few, -few["mdot"]).q_ == 4.0
    with pytest.warns(AdaptationWarning, match="explains"):
        QAdapter(flow, 4.0, base="frozen").fit(few, few["mdot"].sample(frac=1, random_state=0).to_numpy())


def test_one_direction_weak_prior_and_bad_decay(flow):
    few = table(1, factor=4.0)
    with pytest.warns(ExcitationWarning, match="one way only"):
        filling = few[few["dP"] > 0]
        QAdapter(flow, 4.0, base="frozen").fit(filling, filling["mdot"])
    with pytest.warns(ExcitationWarning, match="hardly ties"):
        QAdapter(flow, 4.0, weight_decay=0.0, max_iter=2).fit(few[:30], few["mdot"][:30])
    for wrong in (-1.0, "strong", np.nan):
        with pytest.raises(ParameterError, match="weight_decay"):
            QAdapter(flow, 4.0, weight_decay=wrong).fit(few, few["mdot"])


class Interrupted(LevenbergMarquardt):
    """Ctrl-C comes after the third step."""

    def steps(self, *args, **kwargs):
        for k, step in enumerate(super().steps(*args, **kwargs)):
            if k == 3:
                raise KeyboardInterrupt
            yield step


def test_interruption_keeps_the_best(flow):
    few = table(1, factor=4.0).assign(mdot=lambda d: d["mdot"] * (1 + 0.3 * np.sin(20 * d["eps"])))
    model = QAdapter(flow, 4.0, trainer=Interrupted(), weight_decay=1e-6, warm_start=True)
    with pytest.warns(InterruptedFitWarning):
        model.fit(few, few["mdot"])
    kept = model.loss_curve_[-1]
    assert model.status_ == "interrupted"
    assert np.isfinite(model.predict(few)).all()
    assert model.set_params(trainer=LevenbergMarquardt(max_iter=2)).fit(few, few["mdot"]).loss_curve_[-1] < kept


def test_predictions_outside_the_range_warn(flow):
    few = table(1, factor=4.0)
    model = QAdapter(flow, 4.0, base="frozen").fit(few, few["mdot"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.predict(few)
        flow.predict(table()[SIGNALS])
    with pytest.warns(ExtrapolationWarning, match="dP"):
        model.predict(few.assign(dP=5 * few["dP"]))
    with pytest.warns(ExtrapolationWarning, match="eps"):
        flow.predict(few[SIGNALS].assign(eps=few["eps"] + 0.3))


def test_trainers_of_one_s_own(published):
    few = table(1, factor=4.0)
    model = QAdapter(published, 4.0, trainer=Adam(max_iter=3, learning_rate=1e-3, batch_size=64), random_state=0)
    assert model.fit(few, few["mdot"]).n_iter_ == 3
    with pytest.raises(UnknownOptionError, match="adam"):
        QAdapter(published, 4.0, trainer="sgd").fit(few, few["mdot"])
    held = QAdapter(published, 4.0, weight_decay=1e-6, validation_fraction=0.3, max_iter=4, random_state=0)
    assert len(held.fit(few, few["mdot"]).validation_curve_) >= 1


# --- intervals --------------------------------------------------------------------------------------------------
def offset_runs(rng, n_runs, rows=20):
    """Runs whose errors depend on each other: each has an offset of its own, and its own number of rows."""
    sizes = rng.integers(rows // 2, 2 * rows, n_runs)
    run = np.repeat(np.arange(n_runs), sizes)
    x = rng.normal(size=len(run))
    return x[:, None], x + rng.normal(size=n_runs)[run] + 0.1 * rng.normal(size=len(run)), run


def test_intervals_hold_on_new_trajectories():
    rng, held = np.random.default_rng(0), []
    for _ in range(150):
        X, y, run = offset_runs(rng, 15)
        X_new, y_new, _ = offset_runs(rng, 1)
        model = ConformalRegressor(LinearRegression(), confidence=0.8).fit(X, y, groups=run)
        lower, upper = model.predict_interval(X_new)
        held.append(np.mean((lower < y_new) & (y_new < upper)))
    assert np.mean(held) > 0.8 - 2 * np.std(held) / np.sqrt(len(held))
    assert np.mean(held) < 0.93


def test_intervals_around_an_adapted_model(flow):
    few = table(1, runs=12, factor=4.0, noise=0.05)
    model = ConformalRegressor(QAdapter(FrozenEstimator(flow), 4.0, base="frozen"), confidence=0.8)
    model.fit(few, few["mdot"])
    new = table(2, factor=4.0, noise=0.05)
    lower, upper = model.predict_interval(new)
    assert 0.6 < np.mean((lower < new["mdot"]) & (new["mdot"] < upper)) <= 1.0
    with pytest.raises(MissingTrajectoryError, match="groups"):
        model.fit(few[SIGNALS], few["mdot"])
    with pytest.warns(ExcitationWarning, match="infinite"):
        assert clone(model).set_params(confidence=0.95).fit(few, few["mdot"]).half_width_ == np.inf
    for wrong in ({"confidence": 1.0}, {"n_splits": 1}):
        with pytest.raises(ParameterError):
            clone(model).set_params(**wrong).fit(few, few["mdot"])


# --- command line ---------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    from pamid.cli import main

    folder = tmp_path_factory.mktemp("adapt")
    runs = [
        x for f, a in ((4, 20), (10, 10)) for x in ("--trajectory", f"sine:frequency={f},amplitude={a},seconds=0.6")
    ]
    for muscle in "AB":
        log = str(folder / f"{muscle}.parquet")
        assert main(["simulate", "--muscle", muscle, *runs, "--out", log, "--quiet"]) == 0
    fit = [
        "fit",
        str(folder / "A.parquet"),
        "--estimator",
        "ThermodynamicPIHM",
        "--folds",
        "0",
        "--thin",
        "5",
        "--quiet",
    ]
    small = ["--set", "hidden_layer_sizes=(8,)", "--set", "max_iter=10"]
    assert main([*fit, *small, "--out", str(folder / "A.pamid")]) == 0
    return folder


@pytest.mark.parametrize("method", ["q", "scales", "lora", "partial", "full"])
def test_command_adapts_and_saves(folder, method, capsys):
    from pamid.cli import main

    out = folder / f"{method}.pamid"
    command = ["adapt", str(folder / "A.pamid"), str(folder / "B.parquet"), "--muscle", "B", "--method", method]
    if method == "lora":
        # LoRA's default ranks are for the published network
        assert main([*command, "--out", str(out), "--quiet"]) == 2
        assert "rank" in capsys.readouterr().err
        assert not out.exists()
        return
    folds = ["--folds", "2"] if method == "q" else ["--folds", "0"]
    assert main([*command, *folds, "--samples", "200", "--out", str(out), "--json", "--quiet"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["after"]["rmse"] < 0.5 * report["before"]["rmse"]
    if method == "q":
        assert report["parameters"]["Q0"] == pytest.approx(4.0)
        assert report["parameters"]["Q"] == pytest.approx(4.0, rel=0.1)
        assert report["held_out"]["rmse"] < 0.5 * report["before"]["rmse"]
    elif method == "scales":
        assert report["parameters"]["diameter_factor"] == pytest.approx(2.0, rel=0.05)
    assert load(out).predict(timed_log(folder)).shape == (len(timed_log(folder)),)


def timed_log(folder):
    from pamid.bench import BenchParameters, unfold
    from pamid.signals import read_log

    return unfold(read_log(folder / "B.parquet"), BenchParameters.for_muscle("B"))[["trajectory", "time", "eps", "P"]]


def test_command_says_what_is_wrong(folder, capsys):
    from pamid.cli import main

    command = ["adapt", str(folder / "A.pamid"), str(folder / "B.parquet"), "--out", str(folder / "x.pamid"), "--quiet"]
    for more, word in (
        (["--muscle", "Z"], "muscle"),
        (["--muscle", "0.2,wide"], "--muscle 0.2,0.02"),
        (["--muscle", "0.2,-1"], "positive length"),
        (["--folds", "1"], "--folds"),
    ):
        assert main([*command, *more]) == 2, more
        printed = capsys.readouterr()
        assert word in printed.err
        assert "Traceback" not in printed.err
    assert not (folder / "x.pamid").exists()

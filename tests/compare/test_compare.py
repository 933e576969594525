"""Comparisons: who takes part, folds of whole runs, errors, intervals, floors, failures, and the command."""

from __future__ import annotations

import inspect
import json
import math
import warnings

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GeometricForce, all_estimators
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.linear_model import LinearRegression

from pamid.bench import BenchParameters, simulate, sine, step, triangle, unfold
from pamid.cli import main
from pamid.compare import candidates, compare, prepare
from pamid.compare.bootstrap import ClusterBootstrap
from pamid.compare.comparison import BASELINE, Score, ranked
from pamid.compare.protocol import folds
from pamid.errors import (
    FitError,
    IncompatibleError,
    InterruptedFitWarning,
    MissingColumnError,
    MissingTrajectoryError,
    NonFiniteError,
    ParameterError,
    TooFewTrajectoriesError,
    UnknownOptionError,
)
from pamid.requirements import parameter_count
from pamid.signals import write_log

BENCH = BenchParameters.for_muscle("B")
CLASSICAL = ["GeometricForce(chou_hannaford)", "PolynomialForce", "SINDyRegressor"]


class Broken(RegressorMixin, BaseEstimator):
    def fit(self, X, y):
        raise ArithmeticError("it never works")

    def predict(self, X):
        return np.zeros(len(X))


class Interrupted(LinearRegression):
    """Ctrl-C comes in its fit, which keeps what it has reached."""

    def fit(self, X, y):
        warnings.warn("The training was interrupted.", InterruptedFitWarning, stacklevel=2)
        return super().fit(X, y)


class GivesNothing(LinearRegression):
    def predict(self, X):
        return super().predict(X) * np.nan


class Spy(LinearRegression):
    """Remember which rows, known by their signals, were learnt and predicted."""

    calls: list = []  # noqa: RUF012

    def fit(self, X, y):
        self.calls.append((set(map(tuple, X.to_numpy())), None))
        return super().fit(X, y)

    def predict(self, X):
        self.calls.append((None, set(map(tuple, X.to_numpy()))))
        return super().predict(X)


@pytest.fixture(scope="module")
def log():
    runs = [sine(f, a, 500) for f, a in ((2, 10), (4, 20), (10, 10), (4, 5))]
    runs += [triangle(4, 15, 500), step(0, 10, 500, at=0.1)]
    return simulate(BENCH, runs, seed=0)


@pytest.fixture(scope="module")
def table(log):
    return unfold(log, BENCH)


@pytest.fixture(scope="module")
def result(table):
    return compare(table, "force", CLASSICAL, cv=3, parameters=BENCH.values(), n_draws=300)


# --- who takes part -------------------------------------------------------------------------------------------
def test_every_estimator_of_an_equation_takes_part():
    for equation in ("force", "flow"):
        offered = {n for n, c in all_estimators() if equation in getattr(c, "equations", ())}
        entries = candidates(equation, targets=("F", "mdot"))
        assert {type(e.estimator).__name__ for e in entries} == offered
        assert len({e.label for e in entries}) == len(entries)
    assert {"StaticPIHM", "JointPIHM", "GeometricForce", "PolynomialForce", "SINDyRegressor", "MLP", "Recurrent"} <= {
        type(e.estimator).__name__ for e in candidates("force", targets=("F", "mdot"))
    }


def test_every_predictor_says_what_it_learns():
    """A new estimator that predicts a force or a flow must not be forgotten by a comparison."""
    silent = [(n, c) for n, c in all_estimators() if hasattr(c, "predict") and not getattr(c, "equations", ())]
    # What works on another model cannot enter a comparison without it.
    other = ("source", "nominal", "estimator", "law")
    alone = [n for n, c in silent if next(iter(inspect.signature(c).parameters)) not in other]
    assert alone == ["SINDyModel"]  # rates of states, neither force nor flow


def test_a_joint_estimator_needs_both_sides():
    assert "JointPIHM" not in {e.label for e in candidates("force", targets=("F",))}
    with pytest.raises(IncompatibleError, match="together"):
        candidates("force", ["JointPIHM"])


def test_choosing_by_label_class_and_pattern():
    assert [e.label for e in candidates("force", ["StaticPIHM"])] == ["StaticPIHM"]
    assert len(candidates("force", ["GeometricForce"])) >= 4
    assert len(candidates("force", ["StaticPIHM*", "StaticPIHM"])) == len(candidates("force", ["StaticPIHM*"])) == 2


def test_parameters_reach_those_that_take_them():
    found = {e.label: e.estimator for e in candidates("force", parameters={"rest_length": 0.31, "nothing": 1.0})}
    assert found["StaticPIHM"].rest_length == found["GeometricForce(chou_hannaford)"].rest_length == 0.31
    assert found["MLP"].random_state == 0


def test_wrong_names():
    with pytest.raises(UnknownOptionError, match="Did you mean StaticPIHM"):
        candidates("force", ["StaticPIM"])
    with pytest.raises(IncompatibleError, match="learns flow"):
        candidates("force", ["GeometricFlow"])
    with pytest.raises(UnknownOptionError, match="equation"):
        candidates("torque")
    with pytest.raises(ParameterError, match="'all' or a list"):
        candidates("force", "StaticPIHM")
    with pytest.raises(IncompatibleError, match="fit and predict"):
        candidates("force", {"mine": 3})


# --- the common ground ----------------------------------------------------------------------------------------
def test_rates_do_not_depend_on_the_other_trajectories(table):
    """Rates are taken run by run: one run alone has the same ones as among others, at the same cut-off."""
    whole = prepare(table, "force", tuning=30.0).table
    one = table[table["run"] == "sine-4-20"]
    alone = prepare(one, "force", tuning=30.0).table
    np.testing.assert_allclose(alone["dP"], whole.loc[(table["run"] == "sine-4-20").to_numpy(), "dP"])


def test_folds_hold_whole_runs_and_all_rows_once(table):
    ready = prepare(table, "force", score_rows=2000)
    seen = []
    for fold in folds(ready, 3, fit_rows=400):
        assert not fold.train[fold.test].any()
        assert set(ready.runs[fold.fit_rows]).isdisjoint(ready.runs[fold.score_rows])
        assert len(fold.fit_rows) <= 400
        names = ready.table["trajectory"].to_numpy()[fold.even_test]
        for name in set(names):
            steps = np.diff(ready.table["time"].to_numpy()[fold.even_test][names == name])
            assert np.ptp(steps) < 1e-9
        seen.append(fold.score_rows)
    seen = np.concatenate(seen)
    assert len(seen) == len(set(seen.tolist())) <= 2000


def test_no_row_is_learnt_and_predicted(table):
    Spy.calls = []
    compare(table, "force", {"spy": Spy()}, cv=3, fit_rows=10_000, score_rows=10_000, n_draws=10)
    pairs = Spy.calls[:6]
    predicted = set()
    for (learnt, _), (_, asked) in zip(pairs[::2], pairs[1::2], strict=True):
        assert learnt and asked and not learnt & asked
        predicted |= asked
    assert len(predicted) == len(table)


def test_leaving_kinds_out(table):
    ready = prepare(table, "force")
    kinds = [{r.split("-")[0] for r in ready.runs[f.test]} for f in folds(ready, split="kind")]
    assert kinds == [{"sine"}, {"triangle"}, {"step"}]


def test_rows_that_do_not_count(table):
    keep = (table["F"] > 305).to_numpy()
    result = compare(table, "force", ["PolynomialForce(area)"], cv=3, rows=keep, n_draws=10)
    assert (result.rows["measured"] > 305).all()
    assert len(result.rows) == keep.sum()


def test_an_inverse_is_limited_by_the_supply_where_it_is_known():
    names = ["InverseModel", "InvertedForce(tondu_lopez)"]
    for entry in candidates("inverse", names, parameters=BENCH.values()):
        assert entry.estimator.pressure_limits == (BENCH.gas.atmospheric_pressure, BENCH.gas.supply_pressure)
    assert candidates("inverse", names)[0].estimator.pressure_limits is None


def test_a_sequence_sees_rows_that_do_not_count_without_learning_them(table):
    keep = (table["F"] > 305).to_numpy()
    seen = []

    class Sequence(RegressorMixin, BaseEstimator):
        reads = ("eps", "P")
        sequential = True

        def fit(self, X, y, sample_weight=None):
            seen.append((y, sample_weight))
            self.mean_ = np.average(y, weights=sample_weight)
            return self

        def predict(self, X):
            return np.full(len(X), self.mean_)

    compare(table, "force", {"sequence": Sequence()}, cv=3, rows=keep, n_draws=10)
    assert len(seen) == 3
    for y, weight in seen:
        assert (y <= 305).any()
        np.testing.assert_array_equal(weight, y > 305)


# --- figures --------------------------------------------------------------------------------------------------
def test_the_right_model_reaches_the_noise_floor(result):
    """On a bench of the nominal equations the nominal model leaves the sensors' noise and nothing else."""
    score = result["GeometricForce(chou_hannaford)"]
    assert score.rmse == pytest.approx(result.noise_floor, rel=0.1)
    assert score.n_parameters == 2
    assert result[BASELINE].nrmse == pytest.approx(1.0, abs=0.3)
    assert result[BASELINE].differs
    assert [s.rmse for s in result.scores] == sorted(s.rmse for s in result.scores)


@pytest.mark.parametrize("window", ["auto", 0.0])
def test_the_right_flow_model_reaches_the_noise_floor(table, window):
    slow = table[table["run"].isin(["sine-2-10", "sine-4-20", "sine-4-5"])]
    result = compare(slow, "flow", ["GeometricFlow(chou_hannaford)"], cv=3, window=window, n_draws=10)
    assert 0.5 < result.best.rmse / result.noise_floor < 2.0


def test_errors_follow_from_the_predictions(result):
    for score in result.scores:
        error = result.predictions[score.estimator] - result.rows["measured"].to_numpy()
        assert score.rmse == pytest.approx(np.sqrt(np.mean(error**2)))
        assert score.rmse_low <= score.rmse <= score.rmse_high
        assert score.behind == pytest.approx(score.rmse - result.best.rmse)
        assert score.nrmse == pytest.approx(score.rmse / result.rows["measured"].std(ddof=0))


def test_the_seed_gives_the_same_table(table, result):
    again = compare(table, "force", CLASSICAL, cv=3, parameters=BENCH.values(), n_draws=300)
    timing = ["fit_seconds", "predict_ms_per_1000"]
    pd.testing.assert_frame_equal(again.to_frame().drop(columns=timing), result.to_frame().drop(columns=timing))


def test_interval_covers_as_often_as_it_says():
    """Errors that share a size within a run: rows are many, runs are few, and only runs count."""
    rng = np.random.default_rng(0)
    clusters = np.repeat(np.arange(30), 40)
    truth = math.sqrt(2.0)
    hits = 0
    for k in range(200):
        square = (rng.exponential(2.0, 30)[clusters] ** 0.5 * rng.normal(size=1200)) ** 2
        found = ClusterBootstrap(clusters, 400, random_state=k).rmse(square)
        hits += found.low <= truth <= found.high
    assert 0.80 < hits / 200 < 0.97


def test_paired_differences_cancel_what_runs_share():
    rng = np.random.default_rng(1)
    clusters = np.repeat(np.arange(12), 50)
    hard = rng.exponential(1.0, 12)[clusters]
    draws = ClusterBootstrap(clusters, 500)
    difference = draws.difference(1.2 * hard, hard)
    assert difference.low > 0  # though the intervals of both overlap
    assert draws.rmse(hard).high > draws.rmse(1.2 * hard).low
    assert draws.difference(hard, hard) == (0.0, 0.0, 0.0)


# --- what goes wrong ------------------------------------------------------------------------------------------
def test_one_failure_is_a_line(table):
    models = {"broken": Broken(), "nothing": GivesNothing(), "line": LinearRegression()}
    result = compare(table, "force", models, cv=3, n_draws=10)
    assert not result["line"].error
    assert result["broken"].error == "ArithmeticError: it never works"
    assert "not finite" in result["nothing"].error
    assert "broken: failed" in str(result)
    assert json.loads(json.dumps(result.to_dict(), allow_nan=False))["estimators"][-1]["rmse"] is None
    with pytest.raises(FitError, match="never works"):
        compare(table, "force", {"broken": Broken()}, cv=3)


def test_an_interruption_ends_the_comparison_and_not_one_fit(table):
    with pytest.raises(KeyboardInterrupt):
        compare(table, "force", {"line": LinearRegression(), "interrupted": Interrupted()}, cv=3)


def test_too_few_runs(table):
    one = table[table["run"] == "sine-4-20"]  # two muscles are still one run
    with pytest.raises(TooFewTrajectoriesError, match="1 run"):
        compare(one, "force", CLASSICAL)
    two = table[table["run"].isin(["sine-4-20", "sine-2-10"])]
    result = compare(two, "force", CLASSICAL, cv=5, n_draws=10)
    assert result.n_folds == 2
    assert any("2 runs allow 2 folds" in note for note in result.notes)


@pytest.mark.parametrize(
    ("change", "options", "error"),
    [
        (lambda t: t.drop(columns="F"), {}, MissingColumnError),
        (lambda t: t.drop(columns="trajectory"), {}, MissingTrajectoryError),
        (lambda t: t.assign(P=np.nan), {}, NonFiniteError),
        (lambda t: t, {"fit_rows": 0}, ParameterError),
        (lambda t: t, {"fit_rows": 3}, ParameterError),
        (lambda t: t, {"score_rows": 3}, ParameterError),
        (lambda t: t, {"split": "muscle"}, ParameterError),
        (lambda t: t.assign(deps=0.0, dP=0.0), {"smooth_target": True}, IncompatibleError),
    ],
)
def test_bad_input(table, change, options, error):
    with pytest.raises(error):
        compare(change(table), "force", CLASSICAL, cv=3, **options)


# --- pieces ---------------------------------------------------------------------------------------------------
def test_parameters_are_counted(table):
    X, y = table[["eps", "P"]], table["F"]
    assert parameter_count(GeometricForce("tondu_lopez").fit(X, y)) == 3
    assert parameter_count(LinearRegression().fit(X, y)) == 2
    assert parameter_count(GradientBoostingRegressor(n_estimators=2).fit(X, y)) is None


def test_failures_come_last():
    scores = {"a": Score("a", error="x"), "b": Score("b", rmse=2.0), "c": Score("c", rmse=1.0)}
    assert [s.estimator for s in ranked(scores)] == ["c", "b", "a"]


@pytest.mark.parametrize("name", ["Recurrent", "JointPIHM"])
def test_sequences_and_joint_targets(table, name):
    entry = candidates("force", [name], targets=("F", "mdot"))[0]
    small = {"hidden": 4, "max_iter": 2} if name == "Recurrent" else {"hidden_layer_sizes": (4,), "max_iter": 2}
    model = entry.estimator.set_params(**small)
    few = table[table["run"].isin(["sine-4-20", "sine-2-10"])]
    if name == "Recurrent":
        result = compare(few, "force", {"mine": model}, cv=2, score_rows=500, n_draws=10)
        assert result["mine"].n_fit_rows > 100
        assert not result["mine"].error
    else:
        assert entry.targets == ("F", "mdot")


# --- the command ----------------------------------------------------------------------------------------------
def test_command(log, tmp_path, capsys):
    write_log(log, tmp_path / "log.parquet")
    BENCH.to_toml(tmp_path / "sim.toml")
    out = tmp_path / "out"
    arguments = ["compare", str(tmp_path / "log.parquet"), "--sim", str(tmp_path / "sim.toml"), "--folds", "3"]
    arguments += ["--estimators", "GeometricForce(chou_hannaford),PolynomialForce", "--out", str(out), "--quiet"]
    assert main([*arguments, "--json", "--where", "F > 300"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["estimators"][0]["rmse"] < 0.2
    assert {p.name for p in out.iterdir()} == {
        "comparison-force.csv", "comparison-force.json", "comparison-force.png", "fit-force.png", "volume-force.png",
    }  # fmt: skip
    assert len(pd.read_csv(out / "comparison-force.csv")) == len(data["estimators"])
    assert main(arguments) == 0
    assert "90 % interval" in capsys.readouterr().out
    for bad in (["--where", "F = 3"], ["--where", "G > 3"], ["--folds", "1"], ["--estimators", "Nothing"]):
        assert main([*arguments, *bad]) == 2
        assert "Traceback" not in capsys.readouterr().err


# --- the inverse and free runs --------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def lifts():
    from pamid.bench.single import LiftSettings, simulate_lift

    quick = LiftSettings(frequency=0.25)
    return simulate_lift(loads=(15.0, 30.0, 50.0, 75.0, 100.0), every=20, settings=quick)


def test_the_inverse_is_compared_on_unseen_loads(lifts):
    found = compare(lifts, "inverse", ["InverseModel", "InvertedForce(tondu_lopez)"], cv=3, n_draws=50)
    assert found.unit == "Pa" and not np.isfinite(found.noise_floor)
    assert found["InverseModel"].rmse < 0.5 * found["baseline (mean)"].rmse
    np.testing.assert_allclose(found.rows["measured"], found.rows["P"])
    with pytest.raises(MissingColumnError, match="lacks F"):
        compare(lifts.drop(columns="F"), "inverse")


def test_free_runs_of_a_contraction_under_load(lifts):
    names = ["PolynomialNARX(one step)", "ForwardModel(direction)"]
    found = compare(lifts, "dynamic", names, cv=5, output="eps", n_draws=50)
    assert found.unit == "-"
    assert not [s.error for s in found.scores if s.error]
    assert found.best.rmse < 0.4 * found["baseline (mean)"].rmse
    assert found.fitted["PolynomialNARX(one step)"].start == "initial"
    (plain,) = candidates("dynamic", ["MLP"], output="P")
    assert plain.columns == ("u", "eps", "deps")
    with pytest.raises(UnknownOptionError, match="output"):
        compare(lifts, "dynamic", output="F")


def test_free_runs_of_a_pressure_under_the_valve(table):
    found = compare(table, "dynamic", ["PolynomialNARX(one step)"], cv=2, output="P", n_draws=50)
    assert found.unit == "Pa" and {"u", "deps"} <= set(found.fitted["PolynomialNARX(one step)"].feature_names_in_)
    assert np.isfinite(found["PolynomialNARX(one step)"].rmse)


def test_geometry_reaches_the_model_within():
    (entry,) = candidates("inverse", ["InvertedForce(tondu_lopez)"], parameters={"rest_diameter": 0.031})
    assert entry.estimator.model.rest_diameter == 0.031

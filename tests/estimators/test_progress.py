"""Progress of a fit: callbacks of scikit-learn, early stop, interruption."""

from __future__ import annotations

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import MLP, Recurrent
from pamid.estimators._progress import FitProgress, fit_progress
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pamid.errors import InterruptedFitWarning

pytest.importorskip("sklearn.callback", reason="needs scikit-learn 1.9, which has callbacks")
from sklearn.callback import ProgressBar, ScoringMonitor


class Watcher:
    """Records what the epochs tell, and acts after one of them."""

    def __init__(self, after: int | None = None, act=None) -> None:
        self.after, self.act = after, act
        self.losses: list[float] = []
        self.validation_losses: list[float | None] = []
        self.tasks: list[str] = []
        self.torn_down = 0

    def setup(self, estimator, context): ...

    def teardown(self, estimator, context):
        self.torn_down += 1

    def on_fit_task_begin(self, estimator, context):
        self.tasks.append(context.task_name)

    def on_fit_task_end(self, estimator, context):
        if context.task_name != "epoch":
            return False
        self.losses.append(context.loss)
        self.validation_losses.append(context.validation_loss)
        return self.act() if self.after == len(self.losses) else False


def interrupt():
    raise KeyboardInterrupt


@pytest.fixture
def table():
    rng = np.random.default_rng(1)
    X = pd.DataFrame(
        {
            "eps": rng.uniform(0, 0.25, 120),
            "P": rng.uniform(1e5, 7e5, 120),
            "trajectory": np.repeat(["a", "b", "c", "d"], 30),
        }
    )
    return X, 1e-3 * (X["P"] - 1e5) * (1 - 3 * X["eps"])


MODELS = [
    MLP(("eps", "P"), hidden=(4,), max_iter=6, random_state=0),
    MLP(("eps", "P"), hidden=(4,), max_iter=6, batch_size=16, random_state=0),
    MLP(("eps", "P"), hidden=(4,), max_iter=6, optimizer="lbfgs", random_state=0),
    Recurrent(hidden=3, max_iter=6, window=10, random_state=0),
]
each_model = pytest.mark.parametrize("model", MODELS, ids=["adam", "mini-batch", "lbfgs", "recurrent"])


@each_model
def test_callback_sees_every_epoch(model, table):
    watcher = Watcher()
    fitted = clone(model).set_callbacks(watcher).fit(*table)
    assert watcher.losses == fitted.loss_curve_
    assert watcher.tasks == ["fit"] + ["epoch"] * fitted.n_iter_
    assert watcher.torn_down == 1
    assert set(watcher.validation_losses) == {None}


@each_model
def test_callbacks_do_not_change_the_fit(model, table):
    plain = clone(model).fit(*table)
    watched = clone(model).set_callbacks(Watcher()).fit(*table)
    np.testing.assert_array_equal(plain.predict(table[0]), watched.predict(table[0]))


@each_model
def test_callback_stops_the_fit(model, table):
    watcher = Watcher(after=3, act=lambda: True)
    fitted = clone(model).set_callbacks(watcher).fit(*table)
    assert fitted.n_iter_ == len(fitted.loss_curve_) == 3
    assert np.isfinite(fitted.predict(table[0])).all()


@each_model
def test_interrupted_fit_keeps_its_best(model, table):
    """Ctrl-C after the third epoch leaves the estimator that three epochs would have given, and a warning."""
    watcher = Watcher(after=3, act=interrupt)
    with pytest.warns(InterruptedFitWarning, match="after 3 of at most 6 epochs"):
        interrupted = clone(model).set_callbacks(watcher).fit(*table)
    stopped = clone(model).set_callbacks(Watcher(after=3, act=lambda: True)).fit(*table)
    np.testing.assert_array_equal(interrupted.predict(table[0]), stopped.predict(table[0]))
    assert watcher.torn_down == 1


def test_interruption_before_the_first_epoch_goes_through(table, monkeypatch):
    """With nothing learnt there is nothing to keep."""
    monkeypatch.setattr(MLP, "_epoch", lambda *args: interrupt())
    model = MLP(("eps", "P"))
    with pytest.raises(KeyboardInterrupt):
        model.fit(*table)
    assert not hasattr(model, "weights_")


@each_model
def test_validation_loss_is_told(model, table):
    watcher = Watcher()
    fitted = clone(model).set_params(early_stopping=True, validation_fraction=0.25).set_callbacks(watcher).fit(*table)
    assert watcher.validation_losses == fitted.validation_curve_
    assert len(fitted.validation_curve_) == fitted.n_iter_


@each_model
def test_scoring_monitor(model, table):
    """The monitor scores the best so far after each epoch; the last entry is the fitted estimator's own score."""
    monitor = ScoringMonitor(scoring="r2")
    fitted = clone(model).set_callbacks(monitor).fit(*table)
    scores = [row["r2"] for row in monitor.get_logs().data if "r2" in row]
    assert len(scores) == fitted.n_iter_
    assert scores[-1] == pytest.approx(fitted.score(*table), abs=1e-12)


def test_scoring_monitor_of_grouped_rows(table):
    """Where only groups tell the trajectories, the monitor's prediction still knows them."""
    X, y = table
    monitor = ScoringMonitor(scoring="r2")
    model = Recurrent(hidden=3, max_iter=2, window=10, random_state=0).set_callbacks(monitor)
    model.fit(X[["eps", "P"]], y, groups=X["trajectory"])
    scores = [row["r2"] for row in monitor.get_logs().data if "r2" in row]
    assert scores[-1] == pytest.approx(model.score(X[["eps", "P"]], y, groups=X["trajectory"]), abs=1e-12)
    assert "_codes_of_fit" not in vars(model)


@pytest.mark.slow  # its processes outlive it, so that their time is not counted to it
def test_progress_and_scores_of_a_search_in_two_processes(table, capsys):
    X, y = table
    monitor = ScoringMonitor(scoring="r2")
    model = MLP(("eps", "P"), hidden=(3,), max_iter=3, random_state=0).set_callbacks(monitor)
    pipeline = make_pipeline(StandardScaler(), model)
    search = GridSearchCV(
        pipeline, {"mlp__learning_rate": [1e-3, 1e-2]}, cv=GroupKFold(2), n_jobs=2, error_score="raise"
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*does not support callbacks.*")
        search.set_callbacks(ProgressBar(max_propagation_depth=None)).fit(X[["eps", "P"]], y, groups=X["trajectory"])
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    rows = [row for log in monitor.get_logs(select="all") for row in log.data if "r2" in row]
    assert len(rows) == (4 + 1) * 3  # four fits in the workers and the last one here, three epochs each
    assert "MLP" in capsys.readouterr().out


@each_model
def test_estimator_with_callbacks_is_pickled(model, table):
    fitted = clone(model).set_callbacks(ScoringMonitor(scoring="r2")).fit(*table)
    again = pickle.loads(pickle.dumps(fitted))
    np.testing.assert_array_equal(again.predict(table[0]), fitted.predict(table[0]))


def test_own_loop_without_iterating():
    """A trainer that owns its loop reports epochs without asking for them."""

    class Owner:
        _skl_callbacks = None

    with fit_progress(Owner(), X=None, y=None, max_epochs=2) as progress:
        assert [progress.report(loss) for loss in (3.0, 2.0, 1.0)] == [False, False, False]
    assert progress.losses == [3.0, 2.0, 1.0]
    assert not progress.interrupted


def test_forgotten_report_is_noticed():
    with pytest.raises(RuntimeError, match="report"):
        for _ in FitProgress(None, None, None, 2):
            pass

"""Work on a cluster of worker processes gives what it gives on one, also where a worker is killed on the way."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GeometricForce
from sklearn.model_selection import GridSearchCV, GroupKFold

from pamid.cli import main
from pamid.compare import compare
from pamid.distributed import on_dask
from pamid.errors import MissingDependencyError, ParameterError, needs


class FragileForce(GeometricForce):
    """A force model that says where it is fitted, and whose fourth fit kills its worker; it needs no torch there."""

    def fit(self, X, y, sample_weight=None, groups=None):
        folder = Path(os.environ["PAMID_TEST_FOLDER"])
        (folder / f"{os.getpid()}-{time.time_ns()}").touch()
        time.sleep(0.15)
        if len(list(folder.glob("*-*"))) >= 4 and not (folder / "killed").exists():
            (folder / "killed").write_text(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGKILL)
        return super().fit(X, y, sample_weight, groups)


def data() -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    X = pd.DataFrame(
        rng.uniform([0.02, -0.5, 2e5, -1e6], [0.2, 0.5, 5e5, 1e6], (600, 4)), columns=["eps", "deps", "P", "dP"]
    )
    F = (X["P"] - 101_325) * 5e-4 * (1 - 3 * X["eps"]) + rng.normal(0, 1.0, len(X))
    return X, F.to_numpy(), np.repeat(np.arange(6), 100)


def search(kind: type) -> GridSearchCV:
    return GridSearchCV(kind("tondu_lopez"), {"friction": [False, True]}, cv=GroupKFold(3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("workers")


@pytest.fixture(scope="module")
def client(folder):
    distributed = pytest.importorskip("distributed", reason="dask comes with pamid[distributed]")
    settings = {"PAMID_TEST_FOLDER": str(folder), "OMP_NUM_THREADS": "1"}
    with (
        mock.patch.dict(os.environ, settings),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit=0, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.mark.slow  # of the workers, whose time is not counted to a test
def test_a_search_that_loses_a_worker_is_the_search_on_one(client, folder):
    X, y, groups = data()
    alone = search(GeometricForce).fit(X, y, groups=groups)
    pids = set(client.run(os.getpid).values())
    assert len(pids) == 2
    with on_dask(client) as same:
        assert same is client
        spread = search(FragileForce).fit(X, y, groups=groups)
    killed = int((folder / "killed").read_text())
    ran = {int(file.name.split("-")[0]) for file in folder.glob("*-*")}
    assert killed in pids, "one of the two workers was killed"
    assert ran >= pids, "each worker had its share"
    assert spread.best_params_ == alone.best_params_
    assert np.array_equal(spread.cv_results_["mean_test_score"], alone.cv_results_["mean_test_score"])
    assert np.array_equal(spread.predict(X), alone.predict(X))


@pytest.mark.slow
def test_a_comparison_on_workers_is_that_of_one(client):
    X, y, groups = data()
    table = X[["eps", "P"]].assign(F=y, trajectory=groups, time=np.tile(np.arange(100) * 1e-3, 6))
    names = ["PolynomialForce", "GeometricForce(chou_hannaford)", "GeometricForce(tondu_lopez)"]
    seen: list[str] = []
    settings = {"cv": 3, "n_draws": 50, "parameters": {"rest_length": 0.2, "rest_diameter": 0.02}}
    alone = compare(table, "force", names, **settings, progress=seen.append)
    with on_dask(client):
        spread = compare(table, "force", names, **settings, progress=seen.append)
    assert seen[: len(seen) // 2] == seen[len(seen) // 2 :]
    for label, predicted in alone.predictions.items():
        assert np.array_equal(spread.predictions[label], predicted)
    assert [s.rmse for s in spread.scores] == [s.rmse for s in alone.scores]


def test_a_cluster_that_is_not_there_is_named(tmp_path, capsys):
    pytest.importorskip("distributed", reason="dask comes with pamid[distributed]")
    with pytest.raises(ParameterError, match="n_workers is 0"), on_dask(n_workers=0):
        pass
    import dask

    with (
        dask.config.set({"distributed.comm.timeouts.connect": "0.2s"}),
        pytest.raises(ParameterError, match="no dask cluster at 'tcp"),
        on_dask("tcp://127.0.0.1:9"),
    ):
        pass
    with mock.patch.dict("sys.modules", {"distributed": None}):
        with pytest.raises(MissingDependencyError, match="dask is not installed"), on_dask():
            pass
        log = tmp_path / "log.csv"
        log.write_text("trajectory,time,eps,P,F\n")
        assert main(["compare", str(log), "--dask", "2"]) == 2
        assert "pamid[distributed]" in capsys.readouterr().err


def test_a_package_that_is_missing_is_named_with_what_installs_it() -> None:
    said = r"python-control is not installed. Expected the package control. .*pip install 'pamid\[control\]'"
    with pytest.raises(MissingDependencyError, match=said), needs("python-control", "control", "control"):
        raise ImportError("No module named 'control'")

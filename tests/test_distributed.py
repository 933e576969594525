"""A search on a cluster of worker processes gives what it gives on one."""

from __future__ import annotations

import os
import time
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import pytest
from pamid.estimators import StaticPIHM
from sklearn.model_selection import GridSearchCV, GroupKFold


class SlowForce(StaticPIHM):
    """A force model whose fits take long enough for both workers to get some, and that says where they ran."""

    def fit(self, X, y, sample_weight=None, groups=None):
        Path(os.environ["PAMID_TEST_FOLDER"], f"{os.getpid()}").touch()
        time.sleep(0.3)
        return super().fit(X, y, sample_weight, groups)


def data() -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    X = pd.DataFrame(
        rng.uniform([0.02, -0.5, 2e5, -1e6], [0.2, 0.5, 5e5, 1e6], (120, 4)), columns=["eps", "deps", "P", "dP"]
    )
    F = (X["P"] - 101_325) * 5e-4 * (1 - 3 * X["eps"]) + rng.normal(0, 1.0, len(X))
    return X, F.to_numpy(), np.repeat(np.arange(6), 20)


def search(n_jobs: int | None) -> GridSearchCV:
    grid = {"hidden_layer_sizes": [(2,), (4,)], "weight_decay": [1e-6, 1e-3]}
    model = SlowForce(volume_model="neural", max_iter=5, random_state=0)
    return GridSearchCV(model, grid, cv=GroupKFold(3), n_jobs=n_jobs)


def test_a_search_on_two_workers_is_the_search_on_one(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="dask comes with pamid[distributed]")
    monkeypatch.setenv("PAMID_TEST_FOLDER", str(tmp_path))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    X, y, groups = data()
    alone = search(None).fit(X, y, groups=groups)
    for file in tmp_path.iterdir():
        file.unlink()
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit=0
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = set(client.run(os.getpid).values())
        assert len(pids) == 2
        with joblib.parallel_backend("dask"):
            spread = search(-1).fit(X, y, groups=groups)
    assert {int(file.name) for file in tmp_path.iterdir()} & pids == pids, "each worker had its share"
    assert spread.best_params_ == alone.best_params_
    assert np.array_equal(spread.cv_results_["mean_test_score"], alone.cv_results_["mean_test_score"])
    assert np.array_equal(spread.predict(X), alone.predict(X))
